/// @file
/// The test's end of an executor's socket: sends messages, also invalid ones, and
/// waits for answers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtcf/executor/v1/executor.pb.h"

namespace rtcf::test {

class ExecutorClient {
   public:
    explicit ExecutorClient(const std::string& socket_path);
    ~ExecutorClient();
    ExecutorClient(const ExecutorClient&) = delete;
    ExecutorClient& operator=(const ExecutorClient&) = delete;

    /// A request as sent, with framing.
    static std::string frame(const executor::v1::Request& request);

    void sendBytes(const std::string& bytes) const;
    /// @return the request's id
    std::uint64_t send(executor::v1::Request request);
    void hello();

    /// The next message, or none if the connection has ended. Fails the test at the
    /// deadline.
    std::optional<executor::v1::Response> receive();
    /// The answer to request `id`; skips progress, events and other answers.
    executor::v1::Response answerTo(std::uint64_t id);
    executor::v1::Response ask(const executor::v1::Request& request) {
        return answerTo(send(request));
    }
    /// Whether the peer has closed the connection; waits for it.
    bool isClosed();

   private:
    int fd_;
    std::string in_;
    std::uint64_t next_id_ = 1;
};

}  // namespace rtcf::test
