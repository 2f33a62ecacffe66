/// @file
/// `rtcf-executor --describe`: what a library offers, found out by loading it
/// in this process, which does nothing else and then ends.
#pragma once

#include <string>

namespace rtcf::executor {

/// Writes a LibraryDescription to standard output. @return the process's exit status
int describeLibrary(const std::string& library, const std::string& package);

}  // namespace rtcf::executor
