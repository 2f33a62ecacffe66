#include "watch/port_selection.hpp"

#include <algorithm>

#include "common/error.hpp"
#include "names/names.hpp"

namespace rtcf::executor {

// Parses a pattern. A '[' without ']' matches itself.
PortSelection::Pattern::Pattern(const std::string& text) : given_(text) {
    std::string pattern = text;
    if (pattern[0] != '/' && pattern[0] != '*') pattern.insert(0, "/");
    const std::size_t dot = pattern.rfind('.');
    if (dot == std::string::npos || pattern.find('/', dot) != std::string::npos) pattern += ".**";
    if (pattern.find_first_of("*?[") == std::string::npos) {
        name_ = pattern;
        return;
    }
    for (std::size_t i = 0; i < pattern.size(); ++i) {
        Element element{{}, false};
        if (pattern[i] == '*') {
            const bool twice = i + 1 < pattern.size() && pattern[i + 1] == '*';
            if (twice) ++i;
            element.many = true;
            element.characters.set();
            element.characters['/'] = twice;
        } else if (pattern[i] == '?') {
            element.characters.set();
            element.characters.reset('/');
        } else if (const std::size_t end = pattern.find(']', i + 2);
                   pattern[i] == '[' && end != std::string::npos) {
            for (std::size_t at = i + 1; at < end; ++at) {
                const bool range = at + 2 < end && pattern[at + 1] == '-';
                const auto first = static_cast<unsigned char>(pattern[at]);
                const auto last = static_cast<unsigned char>(pattern[range ? at + 2 : at]);
                for (unsigned character = first; character <= last; ++character)
                    element.characters.set(character);
                if (range) at += 2;
            }
            i = end;
        } else {
            element.characters.set(static_cast<unsigned char>(pattern[i]));
        }
        add(element);
    }
}

void PortSelection::Pattern::add(const Element& element) {
    // Merges consecutive elements that match any number of characters.
    if (element.many && !elements_.empty() && elements_.back().many)
        elements_.back().characters |= element.characters;
    else
        elements_.push_back(element);
}

// Tracks the prefix lengths of the name that the elements so far match, so time and memory are
// bounded for any pattern.
bool PortSelection::Pattern::matches(const std::string& name) const {
    if (!name_.empty()) return name == name_;
    std::vector<char> taken(name.size() + 1, 0);
    taken[0] = 1;
    for (const Element& element : elements_) {
        const auto takes = [&](std::size_t length) {
            return element.characters[static_cast<unsigned char>(name[length - 1])];
        };
        if (element.many) {
            // Matched lengths stay matched, and each can be extended by one character.
            for (std::size_t length = 1; length <= name.size(); ++length) {
                if (taken[length - 1] != 0 && takes(length)) taken[length] = 1;
            }
            continue;
        }
        bool any = false;
        for (std::size_t length = name.size(); length > 0; --length) {
            taken[length] = taken[length - 1] != 0 && takes(length) ? 1 : 0;
            any = any || taken[length] != 0;
        }
        if (!any) return false;
        taken[0] = 0;
    }
    return taken[name.size()] != 0;
}

PortSelection::PortSelection(const std::vector<std::string>& patterns) {
    for (const std::string& given : patterns) {
        if (given.empty()) {
            throw Error(ErrorKind::NameMissing,
                        "a selection of ports is empty: name ports, e.g. /arm/pid.effort, or "
                        "leave it out for all");
        }
        requireLength("a selection of ports", given, kLongestPattern);
        const Pattern& pattern = patterns_.emplace_back(given);
        const std::size_t place = patterns_.size() - 1;
        if (pattern.name().empty())
            wild_.push_back(place);
        else
            names_.try_emplace(pattern.name(), place);
    }
}

std::size_t PortSelection::rank(const std::string& name) const {
    if (patterns_.empty()) return kNone - 1;
    const auto named = names_.find(name);
    std::size_t first = named == names_.end() ? kNone : named->second;
    for (const std::size_t place : wild_) {
        if (place >= first) break;
        if (patterns_[place].matches(name)) first = place;
    }
    return first;
}

}  // namespace rtcf::executor
