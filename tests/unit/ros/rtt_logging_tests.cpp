// rosconsole as used by components of RTCF 2021, in a program without a loop and in the executor.
#include <gtest/gtest.h>
#include <ros/console.h>

#include <algorithm>
#include <rtcf/rt_rosconsole_logging.hpp>
#include <rtcf/rtcf_extension.hpp>
#include <rtt/Component.hpp>
#include <string>
#include <vector>

#include "logging/log.hpp"
#include "ros/logging/console_backend.hpp"

namespace {

class Tested : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Tested(const std::string& name) : TaskContext(name) {}
    void say() {
        RT_INFO("a text");
        RT_WARN_STREAM("force " << 3 << " N");
        rtLogStream(ros::console::levels::Error) << "by stream " << getPeriod();
        NON_RT_INFO("%d joints", 7);
    }
};

class Kept : public ros::console::LogAppender {
   public:
    Kept() { ros::console::register_appender(this); }
    ~Kept() override { ros::console::deregister_appender(this); }
    Kept(const Kept&) = delete;
    Kept& operator=(const Kept&) = delete;
    void log(ros::console::Level level, const char* text, const char* /*file*/,
             const char* /*function*/, int /*line*/) override {
        lines.push_back(std::to_string(static_cast<int>(level)) + " " + text);
    }

    std::vector<std::string> lines;
};

}  // namespace

TEST(RttLogging, AComponentOfATestLogsToRosconsole) {
    Kept kept;
    Tested component("tested");
    component.say();
    EXPECT_EQ(kept.lines, std::vector<std::string>{});
    component.configureTestLogger();
    component.say();
    EXPECT_EQ(kept.lines, (std::vector<std::string>{
                              "2 Component logger was set to non real-time safe test mode.",
                              "1 a text", "2 force 3 N", "3 by stream 0.001", "1 7 joints"}));
}

TEST(RttLogging, ComponentsOfATestLogEachToTheirOwnLogger) {
    std::vector<std::string> loggers;
    rtcf::executor::Log log([&loggers](rtcf::executor::LogEntry&& entry) {
        if (loggers.empty() || loggers.back() != entry.logger) loggers.push_back(entry.logger);
    });
    const rtcf::ros1::ConsoleBackend backend(log);
    Tested one("one");
    Tested other("other");
    one.configureTestLogger();
    other.configureTestLogger();
    one.say();
    other.say();
    one.say();
    log.drain();
    ASSERT_GE(loggers.size(), 3U);
    const std::vector<std::string> last(loggers.end() - 3, loggers.end());
    EXPECT_EQ(last, (std::vector<std::string>{"ros.rtcf.one", "ros.rtcf.other", "ros.rtcf.one"}));
}

TEST(RttLogging, ALoggersLevelAppliesInTheLoop) {
    const std::string logger = std::string(NAME_PREFIX) + "./arm/H1";
    EXPECT_FALSE(RtRosconsoleLogging::setLoggerLevel(logger, ros::console::levels::Debug));
    rtcf::executor::Log log([](rtcf::executor::LogEntry&&) {});
    const rtcf::ros1::ConsoleBackend backend(log);
    std::atomic<rtcf::LogLevel> level{rtcf::LogLevel::Info};
    log.levels().attach("/arm/H1", level);
    EXPECT_TRUE(RtRosconsoleLogging::setLoggerLevel(logger, ros::console::levels::Debug));
    EXPECT_EQ(level, rtcf::LogLevel::Debug);
    log.levels().detach(level);
    EXPECT_FALSE(RtRosconsoleLogging::setLoggerLevel(logger, ros::console::levels::Count));
}
