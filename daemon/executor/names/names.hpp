/// @file
/// Validation and resolution of ROS graph names (http://wiki.ros.org/Names) for components and
/// their ports. Pure functions, not real-time.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace rtcf::executor {

/// Remaps (from, to) in the order and spelling of the user.
using Remaps = std::vector<std::pair<std::string, std::string>>;

constexpr std::size_t kLongestName = 255;      ///< characters; with namespace, as in ROS
constexpr std::size_t kLongestPattern = 1000;  ///< characters of a regular expression

/// Checks a length.
/// @param what name of the text, for the error
/// @throws Error if the text is too long
void requireLength(const char* what, const std::string& text, std::size_t longest = kLongestName);

/// True for a letter followed by letters, digits and underscores.
bool isBaseName(const std::string& name);

/// True for a legal relative, absolute or ~private graph name.
bool isGraphName(const std::string& name);

/// Canonical form of a namespace, e.g. "/arm" for "arm//".
/// @throws Error if it is not a legal namespace
std::string canonicalNamespace(const std::string& ns);

/// Full name of a component: "/" + "H1" = "/H1".
std::string joinName(const std::string& ns, const std::string& name);

/// Resolves a name as a ROS node of namespace `ns` and full name `full_name` would.
std::string resolveName(const std::string& name, const std::string& ns,
                        const std::string& full_name);

/// The mapped name of a port: resolved, remapped, resolved again, as ROS does for topics.
std::string mappedName(const std::string& port, const std::string& ns, const std::string& full_name,
                       const Remaps& remaps);

/// Full name of a component from user input ("H1", "/arm/H1"); relative names are in "/".
/// @throws Error if it is not a legal name
std::string fullNameOf(const std::string& given);

}  // namespace rtcf::executor
