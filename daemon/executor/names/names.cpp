#include "names/names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "common/error.hpp"
#include "common/utf8.hpp"

namespace rtcf::executor {

namespace {

bool isWordCharacter(char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}
bool isLetter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; }

// Removes doubled and trailing slashes.
std::string cleaned(const std::string& name) {
    std::string result;
    for (const char c : name) {
        if (c != '/' || result.empty() || result.back() != '/') result += c;
    }
    if (result.size() > 1 && result.back() == '/') result.pop_back();
    return result;
}

}  // namespace

void requireLength(const char* what, const std::string& text, std::size_t longest) {
    if (text.size() <= longest) return;
    constexpr std::size_t kShown = 40;
    throw Error(ErrorKind::TextTooLong,
                fmt::format("{} '{}…' has {} characters: at most {} are allowed", what,
                            wholeCharacters(std::string_view(text).substr(0, kShown)), text.size(),
                            longest));
}

bool isBaseName(const std::string& name) {
    return !name.empty() && isLetter(name[0]) &&
           std::all_of(name.begin(), name.end(), isWordCharacter);
}

bool isGraphName(const std::string& name) {
    if (name.empty() || (!isLetter(name[0]) && name[0] != '/' && name[0] != '~')) return false;
    return std::all_of(name.begin() + 1, name.end(),
                       [](char c) { return isWordCharacter(c) || c == '/'; });
}

std::string canonicalNamespace(const std::string& ns) {
    if (ns.empty()) return "/";
    requireLength("namespace", ns);
    const std::string absolute = cleaned(ns[0] == '/' ? ns : "/" + ns);
    if (!isGraphName(absolute)) {
        throw Error(
            ErrorKind::NameInvalid,
            "namespace '" + ns + "' is not a legal ROS name: letters, digits, _ and / only");
    }
    return absolute;
}

std::string joinName(const std::string& ns, const std::string& name) {
    return ns == "/" ? "/" + name : ns + "/" + name;
}

std::string resolveName(const std::string& name, const std::string& ns,
                        const std::string& full_name) {
    if (name[0] == '/') return cleaned(name);
    if (name[0] == '~') return cleaned(full_name + "/" + name.substr(1));
    return cleaned(joinName(ns, name));
}

std::string mappedName(const std::string& port, const std::string& ns, const std::string& full_name,
                       const Remaps& remaps) {
    const std::string resolved = resolveName(port, ns, full_name);
    // The last remap of a name wins, as on a ROS command line.
    for (auto remap = remaps.rbegin(); remap != remaps.rend(); ++remap) {
        if (resolveName(remap->first, ns, full_name) == resolved)
            return resolveName(remap->second, ns, full_name);
    }
    return resolved;
}

std::string fullNameOf(const std::string& given) {
    requireLength("component name", given);
    if (!isGraphName(given) || given[0] == '~') {
        throw Error(ErrorKind::NameInvalid, "'" + given + "' is not a component's name");
    }
    return cleaned(given[0] == '/' ? given : "/" + given);
}

}  // namespace rtcf::executor
