#include "watch/port_selection.hpp"

#include <algorithm>

#include "names/names.hpp"
#include "refusal.hpp"

namespace rtcf::executor {

namespace {

// One element of a pattern: what one character, or any number of them, may be.
struct Element {
    enum class Kind { Literal, One, Set, Any, AnyButSlash };
    Kind kind;
    std::string characters;  // of Literal one, of Set pairs of first and last
};

// A '[' without ']' stands for itself.
std::vector<Element> elementsOf(const std::string& pattern) {
    using Kind = Element::Kind;
    std::vector<Element> elements;
    for (std::size_t i = 0; i < pattern.size(); ++i) {
        if (pattern[i] == '*') {
            const bool twice = i + 1 < pattern.size() && pattern[i + 1] == '*';
            if (twice) ++i;
            elements.push_back({twice ? Kind::Any : Kind::AnyButSlash, {}});
        } else if (pattern[i] == '?') {
            elements.push_back({Kind::One, {}});
        } else if (const std::size_t end = pattern.find(']', i + 2);
                   pattern[i] == '[' && end != std::string::npos) {
            Element set{Kind::Set, {}};
            for (std::size_t at = i + 1; at < end; ++at) {
                const bool range = at + 2 < end && pattern[at + 1] == '-';
                set.characters += {pattern[at], range ? pattern[at + 2] : pattern[at]};
                if (range) at += 2;
            }
            elements.push_back(std::move(set));
            i = end;
        } else {
            elements.push_back({Kind::Literal, std::string(1, pattern[i])});
        }
    }
    return elements;
}

bool takes(const Element& element, char character) {
    switch (element.kind) {
        case Element::Kind::Literal:
            return character == element.characters[0];
        case Element::Kind::Set:
            for (std::size_t i = 0; i < element.characters.size(); i += 2) {
                if (element.characters[i] <= character && character <= element.characters[i + 1])
                    return true;
            }
            return false;
        case Element::Kind::Any:
            return true;
        case Element::Kind::One:
        case Element::Kind::AnyButSlash:
            break;
    }
    return character != '/';
}

}  // namespace

PortSelection::PortSelection(const std::vector<std::string>& patterns) {
    for (const std::string& given : patterns) {
        if (given.empty()) {
            throw Refusal(RefusalKind::NameMissing,
                          "a selection of ports is empty: name ports as in /arm/pid.effort, or "
                          "leave it out for all");
        }
        requireLength("a selection of ports", given, kLongestPattern);
        std::string pattern = given;
        if (pattern[0] != '/' && pattern[0] != '*') pattern.insert(0, "/");
        const std::size_t dot = pattern.rfind('.');
        if (dot == std::string::npos || pattern.find('/', dot) != std::string::npos)
            pattern += ".**";
        patterns_.push_back({given, std::move(pattern)});
    }
}

bool PortSelection::matches(const std::string& name) const {
    return patterns_.empty() ||
           std::any_of(patterns_.begin(), patterns_.end(),
                       [&](const Pattern& pattern) { return matches(pattern.full, name); });
}

// Which lengths of the name the elements so far take: time and memory are bounded whatever they
// are.
bool PortSelection::matches(const std::string& pattern, const std::string& name) {
    std::vector<bool> taken(name.size() + 1, false);
    taken[0] = true;
    for (const Element& element : elementsOf(pattern)) {
        const bool many =
            element.kind == Element::Kind::Any || element.kind == Element::Kind::AnyButSlash;
        std::vector<bool> next(name.size() + 1, false);
        for (std::size_t length = 0; length <= name.size(); ++length) {
            if (many && taken[length]) next[length] = true;
            if (length == 0 || !takes(element, name[length - 1])) continue;
            if (many ? next[length - 1] : taken[length - 1]) next[length] = true;
        }
        taken = std::move(next);
    }
    return taken[name.size()];
}

}  // namespace rtcf::executor
