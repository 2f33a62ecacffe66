#include "common/utf8.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

namespace rtcf::executor {

namespace {

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";  // U+FFFD
constexpr std::size_t kLongestCharacter = 4;

enum class Form { Valid, Invalid, Incomplete };

struct Sequence {
    Form form;
    std::size_t length;  // of the character, or of the longest part that could begin one
};

// Characters of several bytes, by their first byte: table 3-7 of the Unicode standard. The third
// and the fourth byte are 0x80 to 0xBF.
struct Row {
    unsigned char first, last;
    std::size_t length;
    unsigned char low, high;  // limits of the second byte
};
constexpr std::array<Row, 8> kRows{{{0xC2, 0xDF, 2, 0x80, 0xBF},
                                    {0xE0, 0xE0, 3, 0xA0, 0xBF},
                                    {0xE1, 0xEC, 3, 0x80, 0xBF},
                                    {0xED, 0xED, 3, 0x80, 0x9F},
                                    {0xEE, 0xEF, 3, 0x80, 0xBF},
                                    {0xF0, 0xF0, 4, 0x90, 0xBF},
                                    {0xF1, 0xF3, 4, 0x80, 0xBF},
                                    {0xF4, 0xF4, 4, 0x80, 0x8F}}};

Sequence sequenceAt(std::string_view text, std::size_t at) noexcept {
    const auto first = static_cast<unsigned char>(text[at]);
    if (first < 0x80U) return {Form::Valid, 1};
    const auto* const row = std::find_if(kRows.begin(), kRows.end(), [first](const Row& each) {
        return first >= each.first && first <= each.last;
    });
    if (row == kRows.end()) return {Form::Invalid, 1};
    for (std::size_t i = 1; i < row->length; ++i) {
        if (at + i == text.size()) return {Form::Incomplete, i};
        const auto byte = static_cast<unsigned char>(text[at + i]);
        const bool second = i == 1;
        if (byte < (second ? row->low : 0x80U) || byte > (second ? row->high : 0xBFU))
            return {Form::Invalid, i};
    }
    return {Form::Valid, row->length};
}

}  // namespace

bool isUtf8(std::string_view text) noexcept {
    for (std::size_t at = 0; at < text.size();) {
        const Sequence sequence = sequenceAt(text, at);
        if (sequence.form != Form::Valid) return false;
        at += sequence.length;
    }
    return true;
}

std::string validUtf8(std::string text) {
    if (isUtf8(text)) return text;
    std::string result;
    result.reserve(text.size() + kReplacement.size());
    for (std::size_t at = 0; at < text.size();) {
        const Sequence sequence = sequenceAt(text, at);
        if (sequence.form == Form::Valid) {
            result.append(text, at, sequence.length);
        } else {
            result += kReplacement;
        }
        at += sequence.length;
    }
    return result;
}

std::string_view wholeCharacters(std::string_view text) noexcept {
    const std::size_t most = std::min(text.size(), kLongestCharacter - 1);
    for (std::size_t back = 1; back <= most; ++back) {
        const std::size_t at = text.size() - back;
        if (sequenceAt(text, at).form == Form::Incomplete) return text.substr(0, at);
    }
    return text;
}

}  // namespace rtcf::executor
