/// @file
/// `rtcf-executor --describe`: lists the component types of a library by loading it, in a process
/// that then ends.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace rtcf::executor {

/// Writes a LibraryDescription to standard output.
/// @param owners users whose libraries are trusted, besides root and the executor's own user
/// @return exit status of the process
int describeLibrary(const std::string& library, const std::string& package,
                    const std::vector<uid_t>& owners);

}  // namespace rtcf::executor
