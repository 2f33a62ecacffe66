/// @file
/// Exceptions of components and libraries.
#pragma once

#include <exception>

namespace rtcf::executor {

/// The text of an exception, whose what() may return null. Real-time safe if what() is.
inline const char* textOf(const std::exception& thrown) noexcept {
    const char* const text = thrown.what();
    return text != nullptr ? text : "an exception without a text";
}

}  // namespace rtcf::executor
