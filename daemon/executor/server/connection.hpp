/// @file
/// One connection from rtcfd: sends and receives messages. On the socket, a message follows its
/// length, 4 bytes little-endian. Main thread only.
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

    /// @param fd a connected, non-blocking stream socket; owned by this object
    Connection(int fd, std::uint64_t id) : fd_(fd), id_(id) {}
    ~Connection();
    Connection(const Connection&) = delete;
    Connection& operator=(const Connection&) = delete;

    int fd() const noexcept { return fd_; }
    std::uint64_t id() const noexcept { return id_; }
    bool greeted() const noexcept { return greeted_; }
    void setGreeted() noexcept { greeted_ = true; }
    /// Number of direct stops that the peer has been told of.
    std::uint64_t toldStops() const noexcept { return told_stops_; }
    void setToldStops(std::uint64_t count) noexcept { told_stops_ = count; }
    bool wantsWrite() const noexcept { return waiting() != 0; }
    /// Number of bytes that the peer has not read.
    std::size_t waiting() const noexcept { return out_.size() - written_; }

    /// Reads received requests.
    /// @return false if the peer has disconnected or sent invalid data
    bool receive(std::vector<v1::Request>& requests);
    /// Queues a message and sends as much as the socket accepts.
    /// @param message from serialized()
    /// @return false if the peer has disconnected, or if too many bytes wait for it
    bool send(const std::string& message);
    /// Continues sending.
    /// @return false if the peer has disconnected
    bool flush();

   private:
    int fd_;
    std::uint64_t id_;
    bool greeted_ = false;
    std::uint64_t told_stops_ = 0;
    std::string in_;
    std::string out_;
    std::size_t written_ = 0;
};

}  // namespace rtcf::executor
