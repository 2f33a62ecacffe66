#include "server/listen.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

namespace rtcf::executor {

namespace {

int spare() noexcept { return ::open("/dev/null", O_RDONLY | O_CLOEXEC); }

}  // namespace

Listener::Listener(const std::string& path, int backlog) {
    const auto fail = [&path](int error) {
        throw std::system_error(error, std::generic_category(), "socket " + path);
    };
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof address.sun_path) fail(ENAMETOOLONG);
    std::copy(path.begin(), path.end(), address.sun_path);
    fd_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd_ < 0) fail(errno);
    ::unlink(path.c_str());
    if (::bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
        ::listen(fd_, backlog) != 0) {
        const int error = errno;
        ::close(fd_);
        fail(error);
    }
    reserve_ = spare();
}

Listener::~Listener() {
    ::close(fd_);
    if (reserve_ >= 0) ::close(reserve_);
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
