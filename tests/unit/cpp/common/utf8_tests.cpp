#include "common/utf8.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace rtcf::test {
namespace {

using executor::isUtf8;
using executor::validUtf8;
using executor::wholeCharacters;

// Encodes any number in a given number of bytes, also where UTF-8 does not allow it.
std::string encoded(std::uint32_t number, std::size_t bytes) {
    if (bytes == 1) return {static_cast<char>(number)};
    constexpr std::array<std::uint32_t, 5> kMarks{0, 0, 0xC0, 0xE0, 0xF0};
    std::string text;
    for (std::size_t i = 0; i + 1 < bytes; ++i) {
        text.insert(text.begin(), static_cast<char>(0x80U | (number & 0x3FU)));
        number >>= 6U;
    }
    text.insert(text.begin(), static_cast<char>(kMarks.at(bytes) | number));
    return text;
}

std::size_t shortestForm(std::uint32_t number) {
    if (number < 0x80) return 1;
    if (number < 0x800) return 2;
    return number < 0x10000 ? 3 : 4;
}

TEST(Utf8, EachCharacterIsValidInItsShortestFormOnly) {
    constexpr std::uint32_t kEnd = 0x200000;  // beyond the last number of 4 bytes
#ifdef RTCF_SANITIZED
    constexpr std::uint32_t kStep = 17;
#else
    constexpr std::uint32_t kStep = 1;
#endif
    for (std::uint32_t number = 0; number < kEnd; number += kStep) {
        const bool surrogate = number >= 0xD800 && number <= 0xDFFF;
        const bool character = !surrogate && number <= 0x10FFFF;
        const std::size_t shortest = shortestForm(number);
        for (std::size_t bytes = shortest; bytes <= 4; ++bytes) {
            const std::string text = encoded(number, bytes);
            ASSERT_EQ(isUtf8(text), character && bytes == shortest)
                << std::hex << number << " in " << bytes << " bytes";
            ASSERT_TRUE(isUtf8(validUtf8(text))) << std::hex << number;
        }
    }
}

TEST(Utf8, ValidTextIsUnchanged) {
    const std::string text = "a\u00E4\u20AC\U0001F916\n\t" + std::string(1, '\0') + "z";
    EXPECT_TRUE(isUtf8(text));
    EXPECT_EQ(validUtf8(text), text);
    EXPECT_TRUE(isUtf8(""));
    EXPECT_EQ(validUtf8(""), "");
}

// As in table 3-8 of the Unicode standard, and as Python's errors="replace".
TEST(Utf8, EachInvalidSequenceIsReplaced) {
    const std::string r = "\uFFFD";
    const std::vector<std::pair<std::string, std::string>> replacements{
        {"Stromst\xE4rke", "Stromst" + r + "rke"},            // Latin-1
        {"\xFF\xFE", r + r},                                  // bytes that never occur
        {"\x80\xBF", r + r},                                  // continuation without a beginning
        {"\xC3", r},                                          // cut
        {"\xE2\x82", r},                                      // cut
        {"\xF0\x9F\xA4", r},                                  // cut
        {"\xE2\x82z", r + "z"},                               // another character too early
        {"\xE2\x82\xC3\xA4", r + "\u00E4"},                   // likewise
        {"\xC0\x80\xC1\xBF", r + r + r + r},                  // overlong
        {"\xE0\x80\xAF", r + r + r},                          // overlong
        {"\xF0\x80\x80\xAF", r + r + r + r},                  // overlong
        {"\xED\xA0\x80\xED\xBF\xBF", r + r + r + r + r + r},  // surrogates
        {"\xF4\x90\x80\x80", r + r + r + r},                  // above U+10FFFF
        {"\xF5\x80\x80\x80", r + r + r + r},                  // likewise
        {"\xF8\x88\x80\x80\x80", r + r + r + r + r},          // five bytes
        {"\x61\xF1\x80\x80\xE1\x80\xC2\x62\x80\x63\x80\xBF\x64",
         "a" + r + r + r + "b" + r + "c" + r + r + "d"},
    };
    for (const auto& [text, expected] : replacements) {
        EXPECT_FALSE(isUtf8(text)) << expected;
        EXPECT_EQ(validUtf8(text), expected);
    }
}

TEST(Utf8, CutAtAnyByteTextKeepsItsWholeCharacters) {
    const std::vector<std::string> characters{"a", "\u00E4", "\u20AC", "\U0001F916", "b"};
    std::string text;
    for (const std::string& character : characters) text += character;
    std::string whole;
    std::size_t next = 0;
    for (std::size_t size = 0; size <= text.size(); ++size) {
        if (next < characters.size() && size == whole.size() + characters[next].size())
            whole += characters[next++];
        EXPECT_EQ(wholeCharacters(std::string_view(text).substr(0, size)), whole) << size;
    }
    EXPECT_EQ(whole, text);
    // Another error at the end is not the cut's.
    EXPECT_EQ(wholeCharacters("a\x80\x80\x80\x80"), "a\x80\x80\x80\x80");
}

}  // namespace
}  // namespace rtcf::test
