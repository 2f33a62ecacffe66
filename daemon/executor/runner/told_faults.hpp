/// @file
/// When a component's values that are not finite are told again: the first one of a loop is told
/// at once, others after a while in which nothing is told, which grows as long as they go on.
/// Owned by the Runner; graph thread.
#pragma once

#include <cstdint>
#include <map>
#include <memory>

#include "loop/schedule.hpp"

namespace rtcf::executor {

class ToldFaults {
   public:
    /// One of a component's was told, and no other is until rearm() says so.
    /// @param now_ns CLOCK_MONOTONIC
    /// @return faults of this component since the one that was told before; 0 = that was the first
    std::uint64_t told(const std::shared_ptr<ComponentFigures>& of, std::int64_t now_ns);
    /// Has the next fault told of those components that were silent for long enough.
    void rearm(std::int64_t now_ns);

   private:
    struct Silence {
        std::int64_t until_ns = 0;
        std::int64_t length_ns = 0;
        std::uint64_t count = 0;  // of the component's faults when the last one was told
        bool over = false;
    };
    std::map<std::shared_ptr<ComponentFigures>, Silence> silences_;
};

}  // namespace rtcf::executor
