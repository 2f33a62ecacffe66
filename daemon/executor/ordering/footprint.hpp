/// @file
/// The memory that a cycle uses. While the loop sleeps others fill the caches, and then each value
/// that a component touches is waited for; asked for all at once, they come side by side. (As in
/// software prefetching for irregular accesses: T. Mowry, Tolerating Latency Through
/// Software-Controlled Data Prefetching, 1994.)
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "loop/schedule.hpp"

namespace rtcf::executor {

constexpr std::size_t kCacheLine = 64;  ///< bytes; of x86-64 and of most arm64
/// The most lines of a footprint: half of a first-level cache of 32 kB, the work of a microsecond.
constexpr std::size_t kLargestFootprint = 256;

/// Cache lines that the steps of a schedule use, in the order of their use, none twice: steps,
/// components, ports, and the values read and written. What does not fit is left out. Graph thread.
/// @param source what an input reads from; null = nothing
std::vector<const void*> footprint(
    const Schedule& schedule, const std::function<const SlotHeader*(const InputBase*)>& source);

}  // namespace rtcf::executor
