/// @file
/// Connections that roscpp refused, mostly for types that differ. roscpp tells
/// nobody but its log, so this listens there.
#pragma once

#include <ros/console.h>

#include <chrono>
#include <mutex>
#include <set>
#include <string>
#include <vector>

namespace rtcf::ros1 {

/// Collects refusals while it lives. Owned by the master watch; roscpp's threads feed it.
class Refusals final : private ros::console::LogAppender {
   public:
    Refusals();
    ~Refusals() override;
    Refusals(const Refusals&) = delete;
    Refusals& operator=(const Refusals&) = delete;

    /// Refusals that were not taken yet, each text once.
    std::vector<std::string> take();

    /// The last one, for a minute; empty without one.
    std::string recent() const;

   private:
    void log(ros::console::Level level, const char* text, const char* file, const char* function,
             int line) override;

    mutable std::mutex mutex_;
    std::set<std::string> known_;
    std::vector<std::string> fresh_;
    std::string last_;
    std::chrono::steady_clock::time_point last_time_;
};

}  // namespace rtcf::ros1
