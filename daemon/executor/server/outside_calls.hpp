/// @file
/// Calls from outside that wait for rtcfd's answer. Owned by the server. The calling threads wait
/// in wait(); the server's thread provides the answers.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>

#include "bridge/outside_call.hpp"

namespace rtcf::executor {

class OutsideCalls {
   public:
    /// @name Calling thread
    /// @{
    /// Registers a call before it is sent.
    /// @return its number
    std::uint64_t begin();
    /// Waits for the answer, at most `timeout`; returns soon after `cancel` becomes true.
    OutsideAnswer wait(std::uint64_t call, std::chrono::milliseconds timeout,
                       const std::atomic<bool>& cancel);
    /// @}

    /// @name Server's thread
    /// @{
    /// Records the connection to which the call was sent.
    void sent(std::uint64_t call, std::uint64_t connection);
    /// Provides the answer.
    /// @return false if the call no longer waits
    bool answer(std::uint64_t call, OutsideAnswer answer);
    /// Fails the calls of a closed connection.
    void lost(std::uint64_t connection);
    /// @}

   private:
    struct Waiting {
        std::uint64_t connection = 0;  // 0 = not sent yet
        std::optional<OutsideAnswer> answer;
    };

    std::mutex mutex_;  // protects all members below
    std::condition_variable answered_;
    std::uint64_t next_ = 1;
    std::map<std::uint64_t, Waiting> waiting_;
};

}  // namespace rtcf::executor
