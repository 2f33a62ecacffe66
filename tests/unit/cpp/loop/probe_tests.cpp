// A query of port values takes a limited part of each cycle.
#include "loop/probe.hpp"

#include <gtest/gtest.h>
#include <std_msgs/String.h>

#include <string>

namespace rtcf::test {
namespace {

class Talkative final : public Component {
   public:
    Talkative() {
        std_msgs::String text;
        text.data.assign(400, 'x');
        for (Output<std_msgs::String>* output : {&a, &b, &c}) output->write(text);
        text.data.assign(5000, 'x');
        large.write(text);
    }
    void update() override {}
    Output<std_msgs::String> a{this, "a"};
    Output<std_msgs::String> b{this, "b"};
    Output<std_msgs::String> c{this, "c"};
    Output<std_msgs::String> large{this, "large"};
};

class ProbeTest : public ::testing::Test {
   protected:
    ProbeTest() {
        for (const OutputPort* output : accessTo(component_).outputs()) probe_.add(*output);
    }
    // The number of boundaries used.
    int boundaries(std::int64_t period_ns) {
        LoopClock clock;
        clock.period_ns = period_ns;
        int count = 1;
        while (!probe_.takeSome(clock)) ++count;
        return count;
    }

    Talkative component_;
    executor::Probe probe_;
};

TEST_F(ProbeTest, IsSpreadOverTheCyclesOfAFastLoop) {
    EXPECT_EQ(boundaries(500'000), 2) << "two values of 400 bytes each time";
    EXPECT_NE(probe_.value(0).text.value_or("").find("xxx"), std::string::npos);
    EXPECT_NE(probe_.value(2).text.value_or("").find("xxx"), std::string::npos);
}

TEST_F(ProbeTest, IsASingleStepInASlowLoop) { EXPECT_EQ(boundaries(100'000'000), 1); }

TEST_F(ProbeTest, LargeValuesAreNotCopied) {
    boundaries(500'000);
    EXPECT_FALSE(probe_.value(3).text.has_value());
    EXPECT_TRUE(probe_.value(3).written);
}

}  // namespace
}  // namespace rtcf::test
