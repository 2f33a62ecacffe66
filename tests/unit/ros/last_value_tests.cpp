// The value written by a component's safe() is the last one of its topics: each subscriber gets it,
// although the topic closes right after it.
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <thread>

#include "ros_fixture.hpp"

namespace {

constexpr int kTimes = 50;

// Reads the listener's lines up to the value written by safe(); false if it does not arrive.
bool getsZero(ChildProcess& listener) {
    while (const auto line = listener.line(10s)) {
        if (*line == "0.0") return true;
    }
    return false;
}

}  // namespace

class LastValueTest : public RosFixture {};

TEST_F(LastValueTest, ReachesSubscribersBeforeTheTopicOfAnUnloadedComponentCloses) {
    startMaster();
    startNode();
    const auto listener = listen("/out");
    for (int i = 0; i < kTimes; ++i) {
        Source source("/out");
        serve({&source}, {});
        ASSERT_NE(flow(source, *listener), "") << i;
        for (int value = 1; value <= 20; ++value) source.write(value);
        source.write(0.0);
        serve({}, {});
        ASSERT_TRUE(getsZero(*listener)) << i;
    }
}

// roscpp starts once per process, so each end has its own.
TEST_F(LastValueTest, ReachesSubscribersBeforeTheNodeEnds) {
    startMaster();
    const auto listener = listen("/out");
    for (int i = 0; i < kTimes; ++i) {
        std::array<int, 2> heard{};  // closed here when the listener has received a value
        ASSERT_EQ(pipe(heard.data()), 0);
        const pid_t child = fork();
        ASSERT_GE(child, 0);
        if (child == 0) {
            close(heard[1]);
            Source source("/out");
            startNode();
            serve({&source}, {});
            std::atomic<bool> ending{false};
            std::thread loop([&] {
                while (!ending) {
                    source.write(1.0);
                    std::this_thread::sleep_for(1ms);
                }
                source.write(0.0);
            });
            char nothing = 0;
            [[maybe_unused]] const ssize_t end = read(heard[0], &nothing, 1);  // closed
            ending = true;
            loop.join();
            stopNode();
            _exit(0);
        }
        close(heard[0]);
        const bool flows = listener->line(30s).has_value();
        close(heard[1]);
        const bool zero = flows && getsZero(*listener);
        int status = -1;
        ASSERT_EQ(waitpid(child, &status, 0), child);
        ASSERT_TRUE(flows) << i;
        ASSERT_TRUE(zero) << i;
        ASSERT_EQ(status, 0) << i;
    }
}

// The end does not wait for a subscriber that reads nothing.
TEST_F(LastValueTest, AStoppedSubscriberDoesNotDelayTheEnd) {
    startMaster();
    startNode();
    Source source("/out");
    serve({&source}, {});
    const auto listener = listen("/out");
    ASSERT_NE(flow(source, *listener), "");
    listener->signal(SIGSTOP);
    // More than the kernel buffers for it.
    constexpr int kMany = 400'000;
    for (int i = 1; i <= kMany; ++i) {
        source.write(i);
        if (i % 1000 == 0) std::this_thread::sleep_for(2ms);
    }
    const auto begin = std::chrono::steady_clock::now();
    stopNode();
    EXPECT_LT(std::chrono::steady_clock::now() - begin, 2s);
    listener->signal(SIGCONT);
}
