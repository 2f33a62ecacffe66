/// @file
/// What marks a function as part of the cycle. A build of the executor with
/// clang's RealtimeSanitizer proves the mark; other compilers ignore it.
#pragma once

#if defined(__has_cpp_attribute)
#if __has_cpp_attribute(clang::nonblocking)
/// Placed after a function's parameters: never allocates, locks, blocks.
#define RTCF_NONBLOCKING [[clang::nonblocking]]
#endif
#endif
#ifndef RTCF_NONBLOCKING
#define RTCF_NONBLOCKING
#endif
