/// @file
/// Words and numbers of a parameter that is a list.
#pragma once

#include <cctype>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <rtcf/read_number.hpp>

namespace rtcf_control {

/// Words separated by spaces or commas. Not real-time safe.
inline std::vector<std::string> words(const std::string& text) {
    std::vector<std::string> found;
    std::string word;
    for (const char c : text + " ") {
        if (c != ',' && std::isspace(static_cast<unsigned char>(c)) == 0) {
            word += c;
        } else if (!word.empty()) {
            found.push_back(word);
            word.clear();
        }
    }
    return found;
}

/// Reads finite numbers separated by spaces or commas. Not real-time safe.
/// @return empty, or the first word that is not a finite number
inline std::string readNumbers(const std::string& text, std::vector<double>& numbers) {
    for (const std::string& word : words(text)) {
        const std::optional<double> number = rtcf::readNumber(word);
        if (!number || !std::isfinite(*number)) return word;
        numbers.push_back(*number);
    }
    return {};
}

}  // namespace rtcf_control
