/// @file
/// Connections that roscpp rejected, mostly because of different types. roscpp reports them only in
/// its log, so this class reads the log.
#pragma once

#include <ros/console.h>

#include <chrono>
#include <mutex>
#include <set>
#include <string>
#include <vector>

namespace rtcf::ros1 {

/// Collects rejections during its life. Owned by RosInterface; called in roscpp's threads.
class RejectedConnections final : private ros::console::LogAppender {
   public:
    RejectedConnections();
    ~RejectedConnections() override;
    RejectedConnections(const RejectedConnections&) = delete;
    RejectedConnections& operator=(const RejectedConnections&) = delete;

    /// Rejections since the last call, each text once.
    std::vector<std::string> take();

    /// The last rejection of the last minute; empty = none.
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
