/// @file
/// The cache lines that a cycle uses, for prefetching. While the loop sleeps, other processes fill
/// the caches, so the cycle would wait for one cache miss after another. Prefetches issued together
/// overlap. (As in software prefetching for irregular accesses: T. Mowry, Tolerating Latency
/// Through Software-Controlled Data Prefetching, 1994.)
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "loop/schedule.hpp"

namespace rtcf::executor {

constexpr std::size_t kCacheLine = 64;  ///< bytes; on x86-64 and most arm64
/// Most lines of a footprint: half of a first-level cache of 32 kB. Prefetching them takes 1 µs.
constexpr std::size_t kLargestFootprint = 256;

/// The cache lines that the steps of a schedule use, in order of use, without duplicates: steps,
/// components, ports, and the values read and written. Lines beyond the limit are omitted. Graph
/// thread.
/// @param source slot that an input reads; null = none
std::vector<const void*> footprint(
    const Schedule& schedule, const std::function<const SlotHeader*(const InputPort*)>& source);

}  // namespace rtcf::executor
