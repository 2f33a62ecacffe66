/// @file
/// A listening unix socket.
#pragma once

#include <string>

namespace rtcf::executor {

/// Listens at a path. It keeps a descriptor in reserve: where the process has none left, one client
/// is let in all the same, and the others wait without being looked at. Not thread-safe.
class Listener {
   public:
    /// In the place of what an executor that was killed has left there. @throws std::system_error
    Listener(const std::string& path, int backlog);
    ~Listener();
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

    int fd() const noexcept { return fd_; }
    /// What to poll fd() for; nothing while there is no descriptor for who comes.
    short events() noexcept;
    /// @return the client's descriptor, not blocking, closed by exec; -1 if there is none
    int accept() noexcept;

   private:
    int fd_ = -1;
    int reserve_ = -1;
};

}  // namespace rtcf::executor
