#include "server/connection.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>

namespace rtcf::executor {

namespace {

constexpr std::size_t kHeader = 4;
// Most bytes queued for a peer that does not read.
constexpr std::size_t kLargestBacklog = 64 * 1024 * 1024;

std::uint32_t lengthOf(const std::string& bytes, std::size_t at) {
    std::uint32_t length = 0;
    for (std::size_t i = 0; i < kHeader; ++i) {
        length |= std::uint32_t{static_cast<unsigned char>(bytes[at + i])} << (8 * i);
    }
    return length;
}

}  // namespace

Connection::~Connection() { ::close(fd_); }

bool Connection::receive(std::vector<v1::Request>& requests) {
    std::array<char, 65536> buffer{};
    const ssize_t count = ::recv(fd_, buffer.data(), buffer.size(), 0);
    if (count < 0) return errno == EAGAIN || errno == EINTR;
    if (count == 0) return false;
    in_.append(buffer.data(), static_cast<std::size_t>(count));
    std::size_t at = 0;
    while (in_.size() - at >= kHeader) {
        const std::uint32_t length = lengthOf(in_, at);
        if (length > kLargestFrame) return false;
        if (in_.size() - at - kHeader < length) break;
        v1::Request request;
        if (!request.ParseFromArray(in_.data() + at + kHeader, static_cast<int>(length)))
            return false;
        requests.push_back(std::move(request));
        at += kHeader + length;
    }
    in_.erase(0, at);
    return true;
}

bool Connection::send(const std::string& message) {
    if (out_.size() - written_ > kLargestBacklog) return false;
    // Removes sent bytes, as a slow peer may never empty the queue.
    if (written_ > out_.size() / 2) {
        out_.erase(0, written_);
        written_ = 0;
    }
    for (std::size_t i = 0; i < kHeader; ++i)
        out_ += static_cast<char>((message.size() >> (8 * i)) & 0xff);
    out_ += message;
    return flush();
}

bool Connection::flush() {
    while (wantsWrite()) {
        const ssize_t count =
            ::send(fd_, out_.data() + written_, out_.size() - written_, MSG_NOSIGNAL);
        if (count < 0) return errno == EAGAIN || errno == EINTR;
        written_ += static_cast<std::size_t>(count);
    }
    out_.clear();
    written_ = 0;
    return true;
}

}  // namespace rtcf::executor
