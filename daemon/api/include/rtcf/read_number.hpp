/// @file
/// Reads numbers from text with a point, in every locale. strtod() and std::stod() read "0.5" as 0
/// after a library has called setlocale() in a country that writes "0,5".
#pragma once

#include <charconv>
#include <cstddef>
#include <optional>
#include <string_view>
#include <system_error>

namespace rtcf {

/// Reads the number with which a text begins, and removes it from the text. Its forms are those of
/// strtod() in the locale "C", except hexadecimal ones: `-0.5`, `+1e-3`, `inf`, `nan`. Not
/// real-time safe.
/// @return nullopt if the text does not begin with a number, or if it is out of the range of double
inline std::optional<double> takeNumber(std::string_view& text) noexcept {
    const char* begin = text.data();
    const char* const end = begin + text.size();
    const bool plus = !text.empty() && text[0] == '+';
    if (plus) ++begin;
    if (plus && begin != end && *begin == '-') return std::nullopt;
    double number = 0.0;
    const auto [rest, error] = std::from_chars(begin, end, number);
    if (error != std::errc()) return std::nullopt;
    text = std::string_view(rest, static_cast<std::size_t>(end - rest));
    return number;
}

/// Reads a text that is one number and nothing else, as takeNumber(). Not real-time safe.
inline std::optional<double> readNumber(std::string_view text) noexcept {
    const std::optional<double> number = takeNumber(text);
    return text.empty() ? number : std::nullopt;
}

}  // namespace rtcf
