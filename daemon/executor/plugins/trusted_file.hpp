/// @file
/// Opens a file that only trusted users can have written or replaced, and checks folders in the
/// same way. Not real-time.
#pragma once

#include <sys/types.h>

#include <set>
#include <string>

namespace rtcf::executor {

/// Opens a regular file for reading. The file and every folder above it, with symbolic links
/// resolved, must belong to root or to one of `owners`, and others must not be able to write there.
/// The check uses the opened descriptors, so that replacing a folder or adding a link meanwhile is
/// detected.
/// @param subject name of the file for errors; empty = the library at `path`
/// @return a descriptor that the caller closes
/// @throws Error naming the untrusted path and its owner or writers
int openTrusted(const std::string& path, const std::set<uid_t>& owners,
                const std::string& subject = {});

/// Requires the same of a folder: only trusted users can put files there, or create it if it does
/// not exist.
/// @throws Error naming the untrusted path and its owner or writers
void requireTrustedFolder(const std::string& path, const std::set<uid_t>& owners,
                          const std::string& subject);

}  // namespace rtcf::executor
