// The logging macros: the stored records, and the resulting text.
#include "rtcf/logging.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "logging/log.hpp"
#include "support/bare_component.hpp"

namespace rtcf::test {
namespace {

using executor::Log;
using executor::LogEntry;

class LoggingMacros : public ::testing::Test {
   protected:
    LoggingMacros() { component.context.log = &log; }

    std::vector<std::string> messages() {
        log.drain();
        std::vector<std::string> result;
        for (const LogEntry& entry : entries) result.push_back(entry.message);
        entries.clear();
        return result;
    }

    std::vector<LogEntry> entries;
    Log log{[this](LogEntry&& entry) { entries.push_back(std::move(entry)); }};
    BareComponent component;
};

enum class Gear : std::uint8_t { Neutral = 0, Third = 3 };
enum Unscoped { kUnscoped = 5 };

TEST_F(LoggingMacros, FormatAllKindsOfArguments) {
    BareComponent* self = &component;
    const std::string text = "string";
    const char* pointer_to_text = "pointer";
    char buffer[] = "array";
    const std::string_view view = "view";
    RTCF_INFO(self, "plain");
    RTCF_INFO(self, "{} {}", text, pointer_to_text);
    RTCF_INFO(self, "{} {}", buffer, view);
    RTCF_INFO(self, "{} {} {}", -1, 2U, std::int64_t{3});
    RTCF_INFO(self, "{:.3f} {} {}", 1.0 / 3.0, 0.5F, true);
    RTCF_INFO(self, "{} {}", Gear::Third, kUnscoped);
    RTCF_INFO(self, "{}", 'c');
    RTCF_INFO(self, "{:#x}", 255);
    RTCF_INFO(self, "{{braces}} {1} {0}", 1, 2);
    EXPECT_EQ(messages(),
              (std::vector<std::string>{"plain", "string pointer", "array view", "-1 2 3",
                                        "0.333 0.5 true", "3 5", "c", "0xff", "{braces} 2 1"}));
}

TEST_F(LoggingMacros, FormatPointersAsAddresses) {
    BareComponent* self = &component;
    RTCF_INFO(self, "{}", static_cast<const void*>(nullptr));
    RTCF_INFO(self, "{}", self);
    const std::vector<std::string> lines = messages();
    EXPECT_EQ(lines[0], "0x0");
    EXPECT_EQ(lines[1], fmt::format("{}", static_cast<const void*>(self)));
}

TEST_F(LoggingMacros, CopyTextAtTheCall) {
    BareComponent* self = &component;
    std::string text = "before";
    RTCF_INFO(self, "{}", text);
    text = "after!";
    EXPECT_EQ(messages(), std::vector<std::string>{"before"});
}

TEST_F(LoggingMacros, CutTextThatIsTooLong) {
    BareComponent* self = &component;
    const std::string text(1000, 'x');
    RTCF_INFO(self, "{}|{}", text, 7);
    EXPECT_EQ(messages(), std::vector<std::string>{std::string(94, 'x') + "|7"});
}

TEST_F(LoggingMacros, RecordTheirSourceLine) {
    BareComponent* self = &component;
    const auto line = static_cast<std::uint32_t>(__LINE__ + 1);
    RTCF_WARN(self, "here");
    log.drain();
    ASSERT_EQ(entries.size(), 1U);
    EXPECT_EQ(entries[0].level, LogLevel::Warn);
    EXPECT_EQ(entries[0].component, "/bare");
    EXPECT_EQ(entries[0].file, __FILE__);
    EXPECT_EQ(entries[0].line, line);
    EXPECT_EQ(entries[0].function, "TestBody");
    EXPECT_FALSE(entries[0].realtime);
    EXPECT_GT(entries[0].time_ns, 1'600'000'000'000'000'000);
}

TEST_F(LoggingMacros, PassTheComponentsLevelOnly) {
    BareComponent* self = &component;
    RTCF_DEBUG(self, "debug");
    RTCF_INFO(self, "info");
    component.context.log_level = LogLevel::Error;
    RTCF_WARN(self, "warn");
    RTCF_ERROR(self, "error");
    RTCF_FATAL(self, "fatal");
    component.context.log_level = LogLevel::Debug;
    RTCF_DEBUG(self, "debug again");
    EXPECT_EQ(messages(), (std::vector<std::string>{"info", "error", "fatal", "debug again"}));
}

TEST_F(LoggingMacros, DoNotEvaluateArgumentsBelowTheLevel) {
    BareComponent* self = &component;
    int calls = 0;
    RTCF_DEBUG(self, "{}", ++calls);
    EXPECT_EQ(calls, 0);
    RTCF_INFO(self, "{}", ++calls);
    EXPECT_EQ(calls, 1) << "evaluated once above the level";
}

TEST_F(LoggingMacros, OnceIsOncePerCall) {
    BareComponent* self = &component;
    for (int i = 0; i < 5; ++i) {
        RTCF_INFO_ONCE(self, "first {}", i);
        RTCF_WARN_ONCE(self, "second {}", i);
    }
    EXPECT_EQ(messages(), (std::vector<std::string>{"first 0", "second 0"}));
}

TEST_F(LoggingMacros, OnceWaitsForItsLevel) {
    BareComponent* self = &component;
    for (int i = 0; i < 3; ++i) {
        component.context.log_level = i == 0 ? LogLevel::Error : LogLevel::Info;
        RTCF_INFO_ONCE(self, "call {}", i);
    }
    EXPECT_EQ(messages(), std::vector<std::string>{"call 1"});
}

// In loop time, at 100 Hz, once in 0.05 s.
TEST_F(LoggingMacros, ThrottleUsesLoopTime) {
    BareComponent* self = &component;
    for (int i = 0; i < 20; ++i) {
        accessTo(component).setTime(std::int64_t{i} * 10'000'000);
        RTCF_INFO_THROTTLE(self, 0.05, "{}", i);
    }
    EXPECT_EQ(messages(), (std::vector<std::string>{"0", "5", "10", "15"}));
}

TEST_F(LoggingMacros, ThrottleFollowsARestartedClock) {
    BareComponent* self = &component;
    for (const std::int64_t time : std::vector<std::int64_t>{3'600'000'000'000, 0, 1}) {
        accessTo(component).setTime(time);
        RTCF_INFO_THROTTLE(self, 1.0, "at {}", time);
    }
    EXPECT_EQ(messages(), (std::vector<std::string>{"at 3600000000000", "at 0"}));
}

}  // namespace
}  // namespace rtcf::test
