/// @file
/// One connected rtcfd: frames in, frames out. A frame is a 4-byte
/// little-endian length and a message. Main thread only.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "rtcf/executor/v1/executor.pb.h"

namespace rtcf::executor {

class Connection {
   public:
    static constexpr std::uint32_t kLargestFrame = 16 * 1024 * 1024;

    /// @param fd a connected stream socket, not blocking; owned from here on
    Connection(int fd, std::uint64_t id) : fd_(fd), id_(id) {}
    ~Connection();
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    int fd() const noexcept { return fd_; }
    std::uint64_t id() const noexcept { return id_; }
    bool greeted() const noexcept { return greeted_; }
    void setGreeted() noexcept { greeted_ = true; }
    bool wantsWrite() const noexcept { return waiting() != 0; }
    /// Bytes that the peer has not taken.
    std::size_t waiting() const noexcept { return out_.size() - written_; }

    /// Reads what has come. @return false if the peer has gone or sent no frames
    bool receive(std::vector<v1::Request>& requests);
    /// Queues a message and sends what the socket takes. @return false if the peer has gone, or
    /// does not read and has too much waiting
    bool send(const v1::Response& response);
    /// Sends on. @return false if the peer has gone
    bool flush();

   private:
    int fd_;
    std::uint64_t id_;
    bool greeted_ = false;
    std::string in_;
    std::string out_;
    std::size_t written_ = 0;
};

}  // namespace rtcf::executor
