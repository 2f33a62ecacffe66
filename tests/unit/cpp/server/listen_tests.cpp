#include "server/listen.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "support/connect_to.hpp"

namespace rtcf {
namespace {

// Uses up all descriptors of the process, except for a few.
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

using test::connectTo;

TEST(Listener, AcceptsOneWithoutFreeDescriptorsAndTheOthersWait) {
    const std::string path = ::testing::TempDir() + "listener-" + std::to_string(::getpid());
    executor::Listener listener(path, 8);
    const int first = connectTo(path);
    const int second = connectTo(path);
    FewDescriptors descriptors(0);
    EXPECT_EQ(listener.events(), POLLIN);
    const int accepted = listener.accept();
    EXPECT_GE(accepted, 0);
    // Polling for connections that cannot be accepted would return immediately, forever.
    EXPECT_EQ(listener.events(), 0);
    EXPECT_EQ(listener.accept(), -1);
    ::close(accepted);
    EXPECT_EQ(listener.events(), POLLIN);
    const int next = listener.accept();
    EXPECT_GE(next, 0);
    ::close(next);
    ::close(first);
    ::close(second);
}

TEST(Listener, RecreatesItsSocketIfItWasRemoved) {
    const std::string path = ::testing::TempDir() + "renewed-" + std::to_string(::getpid());
    constexpr std::int64_t kSecond = 1'000'000'000;
    struct stat made{};
    {
        executor::Listener listener(path, 8, 0600);
        const int before = connectTo(path);
        ::close(listener.accept());
        ::unlink(path.c_str());
        listener.renew(5 * kSecond);
        ASSERT_EQ(::stat(path.c_str(), &made), 0);
        EXPECT_EQ(made.st_mode & 0777U, 0600U);
        const int after = connectTo(path);
        const int accepted = listener.accept();
        EXPECT_GE(accepted, 0);
        for (const int fd : {before, after, accepted}) ::close(fd);
        // It checks once a second, since a check is a system call.
        ::unlink(path.c_str());
        listener.renew(5 * kSecond + 1);
        EXPECT_NE(::stat(path.c_str(), &made), 0);
        listener.renew(6 * kSecond);
        EXPECT_EQ(::stat(path.c_str(), &made), 0);
    }
    EXPECT_NE(::stat(path.c_str(), &made), 0);
}

TEST(Listener, KeepsAnotherSocketInItsPlace) {
    const std::string path = ::testing::TempDir() + "others-" + std::to_string(::getpid());
    std::optional<executor::Listener> first(std::in_place, path, 8);
    executor::Listener second(path, 8);
    first->renew(5'000'000'000);
    first.reset();
    const int client = connectTo(path);
    const int accepted = second.accept();
    EXPECT_GE(accepted, 0);
    ::close(accepted);
    ::close(client);
}

TEST(Listener, WaitsForItsFolderToExistAgain) {
    const std::string folder = ::testing::TempDir() + "folder-" + std::to_string(::getpid());
    ASSERT_EQ(::mkdir(folder.c_str(), 0700), 0);
    executor::Listener listener(folder + "/socket", 8);
    ::unlink((folder + "/socket").c_str());
    ASSERT_EQ(::rmdir(folder.c_str()), 0);
    listener.renew(5'000'000'000);
    ASSERT_EQ(::mkdir(folder.c_str(), 0700), 0);
    listener.renew(6'000'000'000);
    ::close(connectTo(folder + "/socket"));
    ::unlink((folder + "/socket").c_str());
    ::rmdir(folder.c_str());
}

}  // namespace
}  // namespace rtcf
