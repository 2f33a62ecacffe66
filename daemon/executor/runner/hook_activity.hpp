/// @file
/// The hook that the graph thread is running, for queries, which never wait for a hook. Owned by
/// the runner. The graph thread writes it, any thread reads it.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <utility>

#include "realtime/cycle_counter.hpp"

namespace rtcf::executor {

class HookActivity {
   public:
    /// Notes that a hook begins, now.
    /// @param hook COMPONENT.HOOK
    void begin(std::string hook) {
        const std::lock_guard<std::mutex> lock(mutex_);
        hook_ = std::move(hook);
        since_ns_ = monotonicNow();
    }
    /// Notes that no hook runs.
    void end() { begin({}); }

    /// The hook, or an empty string, and since when (CLOCK_MONOTONIC, ns).
    std::pair<std::string, std::int64_t> present() const {
        const std::lock_guard<std::mutex> lock(mutex_);
        return {hook_, since_ns_};
    }

   private:
    mutable std::mutex mutex_;
    std::string hook_;
    std::int64_t since_ns_ = 0;
};

}  // namespace rtcf::executor
