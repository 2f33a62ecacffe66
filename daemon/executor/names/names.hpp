/// @file
/// ROS graph names: legality and resolution (http://wiki.ros.org/Names), as
/// components and their ports use them. Pure functions, not real-time.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace rtcf::executor {

/// Remaps in order of declaration, from and to as written.
using Remaps = std::vector<std::pair<std::string, std::string>>;

constexpr std::size_t kLongestName = 255;      ///< characters; with namespace, as in ROS
constexpr std::size_t kLongestPattern = 1000;  ///< characters of a regular expression

/// Refuses what is too long. @param what it is, for a person
void requireLength(const char* what, const std::string& text, std::size_t longest = kLongestName);

/// True for a letter followed by letters, digits and underscores.
bool isBaseName(const std::string& name);

/// True for a legal relative, absolute or ~private graph name.
bool isGraphName(const std::string& name);

/// "/" and "arm//" become "/", "/arm". @throws Refusal if it is no legal namespace
std::string canonicalNamespace(const std::string& ns);

/// Full name of a component: "/" + "H1" = "/H1".
std::string joinName(const std::string& ns, const std::string& name);

/// Resolves a name as a ROS node of namespace `ns` and full name `full_name` would.
std::string resolveName(const std::string& name, const std::string& ns,
                        const std::string& full_name);

/// The mapped name of a port: resolved, remapped, resolved again, as ROS does for topics.
std::string mappedName(const std::string& port, const std::string& ns, const std::string& full_name,
                       const Remaps& remaps);

/// A component's name as a person gives it ("H1", "/arm/H1") as full name; relative ones are taken
/// in "/".
std::string fullNameOf(const std::string& given);

}  // namespace rtcf::executor
