/// @file
/// Minimum and maximum of each number in a value over several cycles, and the cycles in which they
/// first occurred. One thread; not real-time safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "watch/number_fields.hpp"

namespace rtcf::executor {

class Extremes {
   public:
    explicit Extremes(std::vector<NumberField> fields);

    /// Adds the value of one cycle. Bytes that are not numbers stay those of the first value.
    /// @param value bytes; always of the same length
    /// @param place number of the cycle since the first one
    void add(const std::string& value, std::uint32_t place);
    /// Appends minima, maxima and the places of both, and starts again.
    void take(std::string& values, std::string& places);
    /// Number of bytes that take() appends for a value of `length` bytes.
    std::size_t bytes(std::size_t length) const noexcept { return 2 * (length + 4 * numbers_); }

   private:
    std::vector<NumberField> fields_;
    std::size_t numbers_ = 0;
    std::string least_;  // empty = no value yet
    std::string most_;
    std::vector<std::uint32_t> least_places_;
    std::vector<std::uint32_t> most_places_;
};

}  // namespace rtcf::executor
