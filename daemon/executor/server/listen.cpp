#include "server/listen.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "common/time_units.hpp"

namespace rtcf::executor {

namespace {

int spare() noexcept { return ::open("/dev/null", O_RDONLY | O_CLOEXEC); }

}  // namespace

Listener::Listener(std::string path, int backlog, mode_t mode)
    : path_(std::move(path)), backlog_(backlog), mode_(mode) {
    fd_ = bound(true);
    reserve_ = spare();
}

Listener::~Listener() {
    struct stat found{};
    if (::lstat(path_.c_str(), &found) == 0 && found.st_dev == device_ && found.st_ino == inode_)
        ::unlink(path_.c_str());
    ::close(fd_);
    if (reserve_ >= 0) ::close(reserve_);
}

// Makes a listening socket at the path.
// @throws std::system_error
int Listener::bound(bool replace) {
    int fd = -1;
    const auto fail = [&](int error) {
        if (fd >= 0) ::close(fd);
        throw std::system_error(error, std::generic_category(), "socket " + path_);
    };
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path_.size() >= sizeof address.sun_path) fail(ENAMETOOLONG);
    std::copy(path_.begin(), path_.end(), address.sun_path);
    fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) fail(errno);
    if (replace) ::unlink(path_.c_str());
    struct stat made{};
    if (::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
        (mode_ != 0 && ::chmod(path_.c_str(), mode_) != 0) || ::listen(fd, backlog_) != 0 ||
        ::lstat(path_.c_str(), &made) != 0)
        fail(errno);
    device_ = made.st_dev;
    inode_ = made.st_ino;
    return fd;
}

void Listener::renew(std::int64_t now_ns) noexcept {
    if (now_ns - looked_ns_ < kSecond) return;
    looked_ns_ = now_ns;
    if (::access(path_.c_str(), F_OK) == 0 || errno != ENOENT) return;
    try {
        ::close(std::exchange(fd_, bound(false)));
    } catch (const std::exception&) {
        // The folder is gone, too; try again later.
    }
}

short Listener::events() noexcept {
    if (reserve_ < 0) reserve_ = spare();
    return reserve_ < 0 ? 0 : POLLIN;
}

int Listener::accept() noexcept {
    const auto next = [this] {
        return ::accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    };
    const int fd = next();
    if (fd >= 0 || (errno != EMFILE && errno != ENFILE) || reserve_ < 0) return fd;
    ::close(std::exchange(reserve_, -1));
    return next();
}

}  // namespace rtcf::executor
