/// @file
/// A listening unix socket.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

namespace rtcf::executor {

/// Listens at a path. It keeps a spare descriptor: if the process has none left, one more client
/// can connect, and the others wait in the kernel without being polled. If somebody removes the
/// socket by mistake, it makes a new one. Not thread-safe.
class Listener {
   public:
    /// Replaces the socket of a killed executor.
    /// @param mode file mode of the socket; 0 = by the umask
    /// @throws std::system_error
    Listener(std::string path, int backlog, mode_t mode = 0);
    /// Removes the socket if it is still this object's.
    ~Listener();
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

    int fd() const noexcept { return fd_; }
    /// Events to poll fd() for; 0 while there is no free descriptor.
    short events() noexcept;
    /// Accepts a client.
    /// @return its descriptor, non-blocking and close-on-exec; -1 if there is none
    int accept() noexcept;
    /// Makes a new socket if there is no file at the path, at most once a second. Does not touch
    /// other files.
    void renew(std::int64_t now_ns) noexcept;

   private:
    int bound(bool replace);

    std::string path_;
    int backlog_;
    mode_t mode_;
    dev_t device_ = 0;
    ino_t inode_ = 0;
    std::int64_t looked_ns_ = 0;
    int fd_ = -1;
    int reserve_ = -1;
};

}  // namespace rtcf::executor
