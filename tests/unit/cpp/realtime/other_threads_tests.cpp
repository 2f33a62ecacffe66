// All threads keep off the CPU of a loop, except those with an explicit affinity.
#include "realtime/other_threads.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <functional>
#include <future>
#include <set>
#include <thread>

#include "realtime/cpu_claim.hpp"

namespace rtcf::test {
namespace {

using namespace executor;
using Cpus = std::set<int>;

// A thread that executes requests until the end of the test.
class Worker {
   public:
    explicit Worker(std::function<void()> first = [] {})
        : thread_([this, first = std::move(first)] {
              id_.set_value(::gettid());
              first();
              begun_.set_value();
              done_.get_future().wait();
          }) {
        id = id_.get_future().get();
        begun_.get_future().wait();
    }
    ~Worker() {
        done_.set_value();
        thread_.join();
    }
    Worker(const Worker&) = delete;
    Worker& operator=(const Worker&) = delete;

    pid_t id = 0;

   private:
    std::promise<pid_t> id_;
    std::promise<void> begun_;
    std::promise<void> done_;
    std::thread thread_;
};

Cpus cpusOf(pid_t thread) {
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    sched_getaffinity(thread, sizeof allowed, &allowed);
    Cpus found;
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
        if (CPU_ISSET(cpu, &allowed)) found.insert(cpu);
    }
    return found;
}

void pin(pid_t thread, int cpu) {
    cpu_set_t only;
    CPU_ZERO(&only);
    CPU_SET(cpu, &only);
    ASSERT_EQ(sched_setaffinity(thread, sizeof only, &only), 0);
}

class OtherThreadsTest : public ::testing::Test {
   protected:
    void SetUp() override {
        if (processCpus().size() < 2) GTEST_SKIP() << "one CPU";
        first = processCpus().front();
        last = processCpus().back();
        all = Cpus(processCpus().begin(), processCpus().end());
    }
    void TearDown() override { others.release(); }
    Cpus without(int cpu) const {
        Cpus rest = all;
        rest.erase(cpu);
        return rest;
    }

    OtherThreads others;
    Cpus all;
    int first = 0;
    int last = 0;
};

TEST_F(OtherThreadsTest, KeepOffTheLoopsCpuWhileItRuns) {
    const Worker worker;
    const Worker loop;
    others.keepOff(last, loop.id);
    EXPECT_EQ(cpusOf(worker.id), without(last));
    EXPECT_EQ(cpusOf(loop.id), all);
    const Worker made_later;
    EXPECT_EQ(cpusOf(made_later.id), without(last));
    others.keepOff(first, loop.id);  // a loop that moved
    EXPECT_EQ(cpusOf(worker.id), without(first));
    EXPECT_EQ(cpusOf(made_later.id), without(first));
    EXPECT_EQ(Cpus(processCpus().begin(), processCpus().end()), all)
        << "the original affinity is still known";
    others.release();
    EXPECT_EQ(cpusOf(worker.id), all);
    EXPECT_EQ(cpusOf(made_later.id), all);
}

// The kernel removes a CPU that goes offline from all threads' affinities.
TEST_F(OtherThreadsTest, OfAProcessThatHasLostACpuKeepOffToo) {
    const Worker worker;
    pin(::getpid(), last);
    pin(worker.id, last);
    others.keepOff(last, 0);
    EXPECT_EQ(cpusOf(worker.id), without(last));
    EXPECT_EQ(cpusOf(::getpid()), without(last));
    others.release();
    EXPECT_EQ(cpusOf(worker.id), all);
    EXPECT_EQ(cpusOf(::getpid()), all);
}

TEST_F(OtherThreadsTest, PinnedByAComponentStayOnTheirCpu) {
    const Worker to_the_loops([this] { pin(0, last); });
    const Worker to_another([this] { pin(0, first); });
    others.keepOff(last, 0);
    EXPECT_EQ(cpusOf(to_the_loops.id), Cpus{last});
    EXPECT_EQ(cpusOf(to_another.id), Cpus{first});
    others.keepOff(first, 0);
    EXPECT_EQ(cpusOf(to_the_loops.id), Cpus{last});
    EXPECT_EQ(cpusOf(to_another.id), Cpus{first});
    others.release();
    EXPECT_EQ(cpusOf(to_the_loops.id), Cpus{last});
    EXPECT_EQ(cpusOf(to_another.id), Cpus{first}) << "even if others were kept off that CPU";
}

TEST_F(OtherThreadsTest, ThatPinThemselvesToTheLoopsCpuStayThere) {
    others.keepOff(last, 0);
    const Worker pinned([this] { pin(0, last); });
    others.release();
    EXPECT_EQ(cpusOf(pinned.id), Cpus{last});
}

}  // namespace
}  // namespace rtcf::test
