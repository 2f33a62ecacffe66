/// @file
/// UTF-8 in texts of components. A component may log, throw and declare any bytes, but messages and
/// ROS tools require UTF-8. Pure functions; not for the cycle.
#pragma once

#include <string>
#include <string_view>

namespace rtcf::executor {

/// True if the text is well-formed UTF-8 (RFC 3629): without overlong forms, surrogates and numbers
/// above U+10FFFF.
bool isUtf8(std::string_view text) noexcept;

/// The text with U+FFFD in place of each invalid sequence, as Python's errors="replace". Valid text
/// is returned unchanged.
std::string validUtf8(std::string text);

/// The text without the incomplete character at its end, if there is one. For texts that were cut
/// at a number of bytes.
std::string_view wholeCharacters(std::string_view text) noexcept;

}  // namespace rtcf::executor
