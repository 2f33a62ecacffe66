/// @file
/// Words of a parameter that is a list.
#pragma once

#include <cctype>
#include <string>
#include <vector>

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

}  // namespace rtcf_control
