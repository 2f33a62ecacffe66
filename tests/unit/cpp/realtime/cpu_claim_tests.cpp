#include "realtime/cpu_claim.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <future>
#include <set>
#include <string>
#include <thread>

namespace rtcf::test {
namespace {

using namespace executor;

// Of this test alone: other loops run on the machine.
std::string names() { return "rtcf-test-cpu-" + std::to_string(::getpid()); }

TEST(CpuClaim, SpreadsLoopsOverTheCpus) {
    std::vector<std::unique_ptr<CpuClaim>> loops;
    std::set<int> taken;
    for (std::size_t i = 0; i < processCpus().size(); ++i) {
        loops.push_back(std::make_unique<CpuClaim>(-1, names()));
        EXPECT_TRUE(loops.back()->alone());
        taken.insert(loops.back()->cpu());
    }
    EXPECT_EQ(taken.size(), loops.size());
    EXPECT_EQ(loops.front()->cpu(), processCpus().back()) << "the first has the last";
    // And again, one for each.
    taken.clear();
    for (std::size_t i = 0; i < processCpus().size(); ++i) {
        loops.push_back(std::make_unique<CpuClaim>(-1, names()));
        EXPECT_FALSE(loops.back()->alone());
        taken.insert(loops.back()->cpu());
    }
    EXPECT_EQ(taken.size(), processCpus().size());
    // Where one has gone there are the fewest.
    const int left = loops.back()->cpu();
    loops.pop_back();
    EXPECT_EQ(CpuClaim(-1, names()).cpu(), left);
}

TEST(CpuClaim, PrefersCpusThatAreIsolatedAndThenTheLast) {
    const std::vector<int> cpus{0, 1, 2, 3, 5, 12};
    using Order = std::vector<int>;
    EXPECT_EQ(byPreference(cpus, ""), (Order{12, 5, 3, 2, 1, 0}));
    EXPECT_EQ(byPreference(cpus, "1-2"), (Order{2, 1, 12, 5, 3, 0}));
    EXPECT_EQ(byPreference(cpus, "0,4-5,7"), (Order{5, 0, 12, 3, 2, 1}));
    EXPECT_EQ(byPreference(cpus, "2,"), (Order{2, 12, 5, 3, 1, 0}));
    EXPECT_EQ(byPreference(cpus, "(null)"), (Order{12, 5, 3, 2, 1, 0}));
    EXPECT_TRUE(byPreference({}, "1").empty());
}

TEST(CpuClaim, ThatEndsIsFreeAgain) {
    const int last = processCpus().back();
    {
        const CpuClaim loop(-1, names());
    }
    const CpuClaim next(-1, names());
    EXPECT_EQ(next.cpu(), last);
    EXPECT_TRUE(next.alone());
    const CpuClaim chosen(last, names());
    EXPECT_EQ(chosen.cpu(), last);
    EXPECT_FALSE(chosen.alone()) << "it is where it was told to be, and knows of the other";
}

TEST(CpuClaim, ThreadsKeepOffTheLoopsCpuWhereThereIsAnother) {
    if (processCpus().size() < 2) GTEST_SKIP() << "one CPU";
    const auto mayUse = [](int cpu) {
        cpu_set_t allowed;
        CPU_ZERO(&allowed);
        sched_getaffinity(0, sizeof allowed, &allowed);
        return CPU_ISSET(cpu, &allowed) != 0;
    };
    const int first = processCpus().front();
    const int last = processCpus().back();
    keepThreadsOff(last, 0);
    EXPECT_FALSE(mayUse(last));
    EXPECT_TRUE(mayUse(first));
    std::thread made_later([&] { EXPECT_FALSE(mayUse(last)); });
    made_later.join();
    keepThreadsOff(first, 0);  // a loop that has moved
    EXPECT_TRUE(mayUse(last));
    EXPECT_FALSE(mayUse(first));
    EXPECT_GE(processCpus().size(), 2U) << "it is still known what there was";
    keepThreadsOff(-1, 0);
}

}  // namespace
}  // namespace rtcf::test
