/// @file
/// What a library has the dynamic loader look for, judged before it is loaded:
/// its code is trusted only as far as that of what it links against. Not real-time.
#pragma once

#include <sys/types.h>

#include <set>
#include <string>

namespace rtcf::executor {

/// Requires that the folders of the library's RUNPATH or RPATH, what is found
/// there, what it names by path, and all that these link against likewise, can be
/// written by nobody but root and `owners`. What is found in the system's own
/// folders (ld.so.conf) is the system's affair.
/// @param path for messages; @param file the library, open for reading
/// @throws Refusal naming the library, and the folder or file at fault
void requireTrustedLinks(const std::string& path, int file, const std::set<uid_t>& owners);

/// The files that are loaded into this process as libraries.
std::set<std::string> loadedFiles();

}  // namespace rtcf::executor
