#include "support/executor_client.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>

#include "support/connect_to.hpp"

namespace rtcf::test {

namespace {

constexpr int kPatience = 60'000;  // ms

}  // namespace

ExecutorClient::ExecutorClient(const std::string& socket_path) : fd_(connectTo(socket_path)) {}

ExecutorClient::~ExecutorClient() { ::close(fd_); }

std::string ExecutorClient::frame(const executor::v1::Request& request) {
    const std::string body = request.SerializeAsString();
    std::string bytes;
    for (unsigned i = 0; i < 4; ++i) bytes += static_cast<char>(body.size() >> (8 * i) & 0xff);
    return bytes + body;
}

void ExecutorClient::sendBytes(const std::string& bytes) const {
    for (std::size_t sent = 0; sent < bytes.size();) {
        const ssize_t count = ::send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
        if (count < 0) return;  // the peer has closed; isClosed() tells
        sent += static_cast<std::size_t>(count);
    }
}

std::uint64_t ExecutorClient::send(executor::v1::Request request) {
    request.set_id(next_id_++);
    sendBytes(frame(request));
    return request.id();
}

void ExecutorClient::hello() {
    executor::v1::Request request;
    request.mutable_hello()->set_protocol(1);
    EXPECT_TRUE(ask(request).has_hello());
}

std::optional<executor::v1::Response> ExecutorClient::receive() {
    for (;;) {
        std::uint32_t length = 0;
        if (in_.size() >= 4) {
            for (unsigned i = 0; i < 4; ++i)
                length |= std::uint32_t{static_cast<unsigned char>(in_[i])} << (8 * i);
            if (in_.size() - 4 >= length) {
                executor::v1::Response response;
                EXPECT_TRUE(response.ParseFromArray(in_.data() + 4, static_cast<int>(length)));
                in_.erase(0, 4 + length);
                return response;
            }
        }
        pollfd waiting{fd_, POLLIN, 0};
        if (::poll(&waiting, 1, kPatience) == 0) {
            ADD_FAILURE() << "no answer in time";
            return {};
        }
        std::array<char, 4096> buffer{};
        const ssize_t count = ::recv(fd_, buffer.data(), buffer.size(), 0);
        if (count <= 0) return {};
        in_.append(buffer.data(), static_cast<std::size_t>(count));
    }
}

executor::v1::Response ExecutorClient::answerTo(std::uint64_t id) {
    while (std::optional<executor::v1::Response> response = receive()) {
        using Kind = executor::v1::Response;
        if (response->id() == id && response->kind_case() != Kind::kProgress) return *response;
    }
    ADD_FAILURE() << "request " << id << " was not answered";
    return {};
}

bool ExecutorClient::isClosed() {
    while (receive()) {
    }
    return !::testing::Test::HasFailure();
}

}  // namespace rtcf::test
