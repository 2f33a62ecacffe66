/// @file
/// Check of the files that a library makes the dynamic loader load. A library is trusted only if
/// all libraries that it links against are. Not real-time.
#pragma once

#include <sys/types.h>

#include <set>
#include <string>

namespace rtcf::executor {

/// Requires that only root and `owners` can write the folders of the library's RUNPATH or RPATH,
/// the libraries found there, the libraries it names by path, and recursively those that these link
/// against. Libraries in the system's folders (ld.so.conf) are not checked.
/// @param path name of the library, for errors
/// @param file the library, open for reading
/// @throws Error naming the library and the untrusted folder or file
void requireTrustedLinks(const std::string& path, int file, const std::set<uid_t>& owners);

/// The library files loaded into this process.
std::set<std::string> loadedFiles();

}  // namespace rtcf::executor
