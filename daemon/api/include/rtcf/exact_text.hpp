/// @file
/// Lossless conversion of numbers to text: the shortest text that reads back as the same number.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <ios>
#include <locale>
#include <sstream>

namespace rtcf::detail {

/// Facet of a stream's locale that prints floating-point numbers without loss.
class ExactNumbers final : public std::num_put<char> {
   protected:
    iter_type do_put(iter_type out, std::ios_base& stream, char_type fill,
                     double value) const override {
        (void)stream;
        (void)fill;
        constexpr std::size_t kLongest = 32;
        std::array<char, kLongest> text{};
        const auto* end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
        return std::copy(static_cast<const char*>(text.data()), end, out);
    }
};

/// Makes a stream print floating-point numbers without loss. Not real-time safe.
inline void makeExact(std::ostream& stream) {
    stream.imbue(std::locale(std::locale::classic(), new ExactNumbers));  // the locale owns it
}

}  // namespace rtcf::detail
