#include "server/listen.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <vector>

namespace rtcf {
namespace {

// All descriptors that a process may have, but for so many.
class FewDescriptors {
   public:
    explicit FewDescriptors(std::size_t left) {
        for (int fd = ::open("/dev/null", O_RDONLY | O_CLOEXEC); fd >= 0;
             fd = ::open("/dev/null", O_RDONLY | O_CLOEXEC))
            held_.push_back(fd);
        for (std::size_t i = 0; i < left; ++i) giveOne();
    }
    ~FewDescriptors() {
        while (!held_.empty()) giveOne();
    }
    FewDescriptors(const FewDescriptors&) = delete;
    FewDescriptors& operator=(const FewDescriptors&) = delete;

    void giveOne() {
        ::close(held_.back());
        held_.pop_back();
    }

   private:
    std::vector<int> held_;
};

int connectTo(const std::string& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::copy(path.begin(), path.end(), address.sun_path);
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    EXPECT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    return fd;
}

TEST(Listener, LetsOneInWhenNoDescriptorIsLeftAndTheOthersWait) {
    const std::string path = ::testing::TempDir() + "listener-" + std::to_string(::getpid());
    executor::Listener listener(path, 8);
    const int first = connectTo(path);
    const int second = connectTo(path);
    FewDescriptors descriptors(0);
    EXPECT_EQ(listener.events(), POLLIN);
    const int accepted = listener.accept();
    EXPECT_GE(accepted, 0);
    // To poll for what cannot be taken would come back at once, for ever.
    EXPECT_EQ(listener.events(), 0);
    EXPECT_EQ(listener.accept(), -1);
    ::close(accepted);
    EXPECT_EQ(listener.events(), POLLIN);
    const int next = listener.accept();
    EXPECT_GE(next, 0);
    ::close(next);
    ::close(first);
    ::close(second);
    ::unlink(path.c_str());
}

}  // namespace
}  // namespace rtcf
