/// @file
/// The executor's own stop socket, for users when rtcfd is dead, stopped or busy. A separate thread
/// serves it, nearly independent of the main thread and the graph thread. executor.proto defines
/// the protocol, at DirectStop.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "access/rights.hpp"
#include "rtcf/executor/v1/executor.pb.h"
#include "server/listen.hpp"
#include "server/resume_mark.hpp"

namespace rtcf::executor {

/// The client that stopped the loop, and the time.
struct DirectStopReport {
    std::uint64_t count = 0;  ///< stops so far; 0 = none
    uid_t user = 0;
    pid_t pid = 0;
    std::int64_t at_ns = 0;  ///< CLOCK_MONOTONIC
};

/// Conversion to the message for rtcfd.
v1::DirectStop directStopTo(const DirectStopReport& report);

/// The loop to stop. The socket's thread calls both functions.
struct Stoppable {
    /// Stops the loop at the next boundary, and voids earlier start requests.
    std::function<void()> stop;
    std::function<bool()> running;
};

class DirectStop {
   public:
    /// Listens on the socket.
    /// @param path path of the socket; empty = none
    /// @param mark file that each stop removes, so that the loop is not resumed; empty = none
    /// @throws std::system_error
    DirectStop(std::string path, std::string mark, const Access& access);
    ~DirectStop();
    DirectStop(const DirectStop&) = delete;
    DirectStop& operator=(const DirectStop&) = delete;

    /// Starts the thread.
    /// @param what outlives close()
    void serve(Stoppable what);
    /// Ends the thread.
    void close() noexcept;
    /// The last stop. Any thread.
    DirectStopReport last() const;

   private:
    struct Client {
        int fd;
        uid_t user;
        pid_t pid;
        bool asked;
        std::int64_t until_ns;
        std::int64_t saved_until_ns;  // end of the wait for the disk
        std::string text;
    };

    void threadMain();
    /// Accepts all clients that wait, unless there are too many.
    void accept();
    void admit(int fd);
    /// Handles one client, without waiting for it; counts its request to stop.
    /// @return false if the client is to be disconnected
    bool attend(Client& client);
    /// Answers a client after the end of the loop.
    /// @return false if the answer still waits for the disk
    bool answerStopped(const Client& client) const;
    void countStop(const Client& client);

    ResumeMark mark_;
    const Access& access_;
    Stoppable what_;
    std::optional<Listener> listener_;  // unset without a path
    int wake_ = -1;
    std::atomic<bool> ending_{false};
    std::vector<Client> clients_;
    mutable std::mutex mutex_;
    DirectStopReport last_;
    std::thread thread_;
};

}  // namespace rtcf::executor
