/// @file
/// Opens a file that nobody but those who are trusted can have written or put
/// in its place; judges folders likewise. Not real-time.
#pragma once

#include <sys/types.h>

#include <set>
#include <string>

namespace rtcf::executor {

/// Opens a regular file for reading. The file and every folder above it, symbolic
/// links resolved, must belong to root or to one of `owners`, and others must not
/// be able to write there. What is checked is what is opened: a link or folder
/// that is exchanged meanwhile is refused.
/// @param subject what a refusal is about; empty = the library at `path`
/// @return a descriptor that the caller closes
/// @throws Refusal naming the path at fault and who could write there
int openTrusted(const std::string& path, const std::set<uid_t>& owners,
                const std::string& subject = {});

/// Requires the same of a folder: only those who are trusted put something there,
/// or make it if there is none.
/// @throws Refusal likewise
void requireTrustedFolder(const std::string& path, const std::set<uid_t>& owners,
                          const std::string& subject);

}  // namespace rtcf::executor
