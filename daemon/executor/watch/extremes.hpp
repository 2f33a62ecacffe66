/// @file
/// The smallest and the largest of each number of a value over some cycles, and when they were
/// there first. One thread; not real-time safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "watch/number_fields.hpp"

namespace rtcf::executor {

class Extremes {
   public:
    explicit Extremes(std::vector<NumberField> fields);

    /// Takes the value of one cycle. What is no number in it stays that of the first.
    /// @param value bytes, as many each time
    /// @param place of the cycle: how many after the first one there can be
    void add(const std::string& value, std::uint32_t place);
    /// Appends the two values, minima and maxima, and the places of their numbers; begins anew.
    void take(std::string& values, std::string& places);
    /// Bytes that take() appends for a value of that length.
    std::size_t bytes(std::size_t length) const noexcept { return 2 * (length + 4 * numbers_); }

   private:
    std::vector<NumberField> fields_;
    std::size_t numbers_ = 0;
    std::string least_;  // empty = nothing has come
    std::string most_;
    std::vector<std::uint32_t> least_places_;
    std::vector<std::uint32_t> most_places_;
};

}  // namespace rtcf::executor
