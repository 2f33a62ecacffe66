/// @file
/// `rtcf-executor --describe`: what a library offers, found out by loading it
/// in this process, which does nothing else and then ends.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace rtcf::executor {

/// Writes a LibraryDescription to standard output. @return the process's exit status
/// @param owners users whose libraries are trusted besides root's and our own
int describeLibrary(const std::string& library, const std::string& package,
                    const std::vector<uid_t>& owners);

}  // namespace rtcf::executor
