/// @file
/// A listening unix socket.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

namespace rtcf::executor {

/// Listens at a path. It keeps a descriptor in reserve: where the process has none left, one client
/// is let in all the same, and the others wait without being looked at. Somebody may remove its
/// socket by mistake: it makes another. Not thread-safe.
class Listener {
   public:
    /// In the place of what an executor that was killed has left there.
    /// @param mode of the socket; 0 = as the umask says
    /// @throws std::system_error
    Listener(std::string path, int backlog, mode_t mode = 0);
    /// Removes the socket, if it is still its own.
    ~Listener();
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

    int fd() const noexcept { return fd_; }
    /// What to poll fd() for; nothing while there is no descriptor for who comes.
    short events() noexcept;
    /// @return the client's descriptor, not blocking, closed by exec; -1 if there is none
    int accept() noexcept;
    /// Makes the socket anew if there is none at its path, at most once a second. Leaves alone what
    /// somebody else has put there.
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
