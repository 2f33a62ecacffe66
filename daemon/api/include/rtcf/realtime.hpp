/// @file
/// Attribute of functions that run in the cycle. clang's RealtimeSanitizer checks it in a special
/// build of the executor; other compilers ignore it.
#pragma once

#if defined(__has_cpp_attribute)
#if __has_cpp_attribute(clang::nonblocking)
/// Placed after a function's parameters: the function never allocates, locks or blocks.
#define RTCF_NONBLOCKING [[clang::nonblocking]]
#endif
#endif
#ifndef RTCF_NONBLOCKING
#define RTCF_NONBLOCKING
#endif
