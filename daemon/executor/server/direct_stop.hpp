/// @file
/// The executor's own stop: a socket beside the server's, for people and not
/// for rtcfd, which may be dead, stopped, or busy with others. A thread of its
/// own serves it; what the main or the graph thread does holds it up as little.
/// The protocol stands in executor.proto, at DirectStop.
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

/// Who has stopped the loop, and when.
struct DirectStopReport {
    std::uint64_t count = 0;  ///< stops so far; 0 = none
    uid_t user = 0;
    pid_t pid = 0;
    std::int64_t at_ns = 0;  ///< CLOCK_MONOTONIC
};

/// As rtcfd is told.
v1::DirectStop directStopTo(const DirectStopReport& report);

/// What is stopped. Both are called by the socket's thread.
struct Stoppable {
    /// Ends the loop at the next boundary, and lets no start that was asked for before happen.
    std::function<void(const DirectStopReport&)> stop;
    std::function<bool()> running;
};

class DirectStop {
   public:
    /// Listens. @param path of the socket; empty = none @param mark file to be removed with each
    /// stop, by which a loop would be resumed; empty = none
    /// @throws std::system_error
    DirectStop(std::string path, std::string mark, const Access& access);
    ~DirectStop();
    DirectStop(const DirectStop&) = delete;
    DirectStop& operator=(const DirectStop&) = delete;

    /// Begins to serve. @param what outlives close()
    void serve(Stoppable what);
    /// Ends serving.
    void close() noexcept;
    /// Any thread.
    DirectStopReport last() const;

   private:
    struct Client {
        int fd;
        uid_t user;
        pid_t pid;
        bool asked;
        std::int64_t until_ns;
        std::int64_t saved_until_ns;  // for the disk
        std::string text;
    };

    void threadMain();
    void accept();
    /// @return false if the client is to be let go
    bool attend(Client& client, bool readable);
    /// Answers a client after the end of the loop, if there is an answer yet.
    bool answerStopped(const Client& client) const;
    void stop(const Client& client);

    ResumeMark mark_;
    const Access& access_;
    Stoppable what_;
    std::optional<Listener> listener_;  // none without a path
    int wake_ = -1;
    std::atomic<bool> ending_{false};
    std::vector<Client> clients_;
    mutable std::mutex mutex_;
    DirectStopReport last_;
    std::thread thread_;
};

}  // namespace rtcf::executor
