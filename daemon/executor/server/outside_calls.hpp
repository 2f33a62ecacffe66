/// @file
/// Calls from outside that wait for the daemon's answer. Owned by the server.
/// The asking threads wait in here; the server's thread says what becomes of
/// their calls.
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
    /// @name By the asking thread
    /// @{
    /// A call that is about to be sent. @return its number
    std::uint64_t begin();
    /// Waits for its answer, at most `timeout` and not long after `cancel` becomes true.
    OutsideAnswer wait(std::uint64_t call, std::chrono::milliseconds timeout,
                       const std::atomic<bool>& cancel);
    /// @}

    /// @name By the server's thread
    /// @{
    /// It went to this connection, whose end ends it.
    void sent(std::uint64_t call, std::uint64_t connection);
    /// @return false if nobody waits for it any more
    bool answer(std::uint64_t call, OutsideAnswer answer);
    /// The connection has ended: its calls have failed.
    void lost(std::uint64_t connection);
    /// @}

   private:
    struct Waiting {
        std::uint64_t connection = 0;  // 0 = not sent yet
        std::optional<OutsideAnswer> answer;
    };

    std::mutex mutex_;  // all below
    std::condition_variable answered_;
    std::uint64_t next_ = 1;
    std::map<std::uint64_t, Waiting> waiting_;
};

}  // namespace rtcf::executor
