#include "logging/log.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "support/bare_component.hpp"

namespace rtcf::test {
namespace {

using executor::Log;
using executor::LogEntry;

class LogTest : public ::testing::Test {
   protected:
    LogTest() { component.context.log = &log; }

    std::vector<LogEntry> entries;
    Log log{[this](LogEntry&& entry) { entries.push_back(std::move(entry)); }};
    BareComponent component;
};

TEST_F(LogTest, KeepsTheOrderOfOneThread) {
    BareComponent* self = &component;
    for (int i = 0; i < 100; ++i) RTCF_INFO(self, "{}", i);
    log.drain();
    ASSERT_EQ(entries.size(), 100U);
    for (int i = 0; i < 100; ++i)
        EXPECT_EQ(entries[static_cast<std::size_t>(i)].message, std::to_string(i));
}

TEST_F(LogTest, DroppedRecordsAreCountedAndReportedOnce) {
    BareComponent* self = &component;
    for (int i = 0; i < 1030; ++i) RTCF_INFO(self, "{}", i);
    EXPECT_EQ(log.dropped(), 6U);
    log.drain();
    ASSERT_EQ(entries.size(), 1025U);
    EXPECT_EQ(entries.back().level, LogLevel::Warn);
    EXPECT_EQ(entries.back().message.rfind("6 log records were dropped", 0), 0U)
        << entries.back().message;
    entries.clear();
    RTCF_INFO(self, "one more");
    log.drain();
    EXPECT_EQ(entries.size(), 1U);
}

TEST_F(LogTest, RecordsIterationAndThread) {
    BareComponent* self = &component;
    const std::atomic<std::uint64_t> iteration{42};
    log.setIteration(&iteration);
    std::thread([&] {
        Log::setRealtimeThread(true);
        RTCF_INFO(self, "in the loop");
    }).join();
    log.drain();
    ASSERT_EQ(entries.size(), 1U);
    EXPECT_TRUE(entries[0].realtime);
    EXPECT_EQ(entries[0].iteration, 42U);
}

TEST_F(LogTest, OwnRecordGoesToTheConsumerImmediately) {
    log.write(LogLevel::Error, "/H1", "text");
    ASSERT_EQ(entries.size(), 1U);
    EXPECT_EQ(entries[0].message, "text");
    EXPECT_EQ(entries[0].component, "/H1");
}

TEST_F(LogTest, AcceptsRecordsOfManyThreadsAtOnce) {
    constexpr int kThreads = 4;
    constexpr int kEach = 5000;
    std::atomic<int> running{kThreads};
    std::vector<std::thread> threads;
    for (int id = 0; id < kThreads; ++id) {
        threads.emplace_back([&, id] {
            Log::setRealtimeThread(id == 0);
            BareComponent* self = &component;
            for (int i = 0; i < kEach; ++i) RTCF_INFO(self, "{} {}", id, i);
            --running;
        });
    }
    while (running > 0) log.drain();
    for (std::thread& thread : threads) thread.join();
    log.drain();
    std::map<int, int> last;
    std::uint64_t seen = 0;
    for (const LogEntry& entry : entries) {
        if (entry.component.empty()) continue;  // a report of dropped records
        int id = 0;
        int number = 0;
        ASSERT_TRUE(std::istringstream(entry.message) >> id >> number) << entry.message;
        if (const auto before = last.find(id); before != last.end()) {
            ASSERT_GT(number, before->second);
        }
        last[id] = number;
        ++seen;
    }
    EXPECT_EQ(seen + log.dropped(), std::uint64_t{kThreads * kEach});
}

TEST_F(LogTest, AFloodOfOneLineIsSuppressedAndCounted) {
    log.setLimit(10);
    BareComponent* self = &component;
    for (int i = 0; i < 997; ++i) RTCF_INFO(self, "flood {}", i);
    RTCF_WARN(self, "another line");
    log.end();
    ASSERT_EQ(entries.size(), 12U);
    EXPECT_EQ(entries[9].message, "flood 9");
    EXPECT_EQ(entries[10].message, "another line");
    EXPECT_EQ(entries[11].message, "987 more records of this line within a second were suppressed");
    EXPECT_EQ(entries[11].line, entries[0].line);
    EXPECT_EQ(entries[11].component, entries[0].component);
}

TEST(LogLimit, RestartsAfterASecondSeparatelyForEachComponent) {
    constexpr std::int64_t kSecond = 1'000'000'000;
    executor::LogLimit limit;
    limit.set(1);
    const executor::LogOrigin one{"/one", "a.cpp", 7, LogLevel::Info};
    const executor::LogOrigin two{"/two", "a.cpp", 7, LogLevel::Info};
    EXPECT_TRUE(limit.admit(one, 0));
    EXPECT_FALSE(limit.admit(one, 1));
    EXPECT_TRUE(limit.admit(two, 1));
    std::map<std::string, std::uint64_t> counts;
    const auto count = [&](const executor::LogOrigin& origin, std::uint64_t left_out) {
        counts[origin.component] += left_out;
    };
    limit.report(kSecond - 1, count);
    EXPECT_TRUE(counts.empty());
    limit.report(kSecond, count);
    EXPECT_EQ(counts, (std::map<std::string, std::uint64_t>{{"/one", 1}}));
    EXPECT_TRUE(limit.admit(one, kSecond + 1));
}

}  // namespace
}  // namespace rtcf::test
