/// @file
/// Median of measured durations.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace rtcf::bench {

/// @param values at least one
inline double median(std::vector<double> values) {
    std::nth_element(values.begin(),
                     values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
    return values[values.size() / 2];
}

}  // namespace rtcf::bench
