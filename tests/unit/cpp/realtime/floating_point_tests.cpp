// Changes of the floating-point environment by a loaded library do not affect the loop.
#include <gtest/gtest.h>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

class FloatingPoint : public RunnerFixture {
   protected:
    FloatingPoint() {
        onGraphThread([this] {
            return runner().load(definition("FastMath", "F"), RTCF_UNIT_COMPONENTS "/fast_math.so",
                                 [](const std::string&) {});
        });
        load(definition("Subnormal", "S"));
    }
};

TEST_F(FloatingPoint, IsTheDefaultInTheLoop) {
    start();
    ASSERT_TRUE(runs());
    stop();
    EXPECT_EQ(value("/S", "out"), 3e-308 / 16.0);
}

TEST_F(FloatingPoint, IsTheSameInSteps) {
    step(3);
    EXPECT_EQ(value("/S", "out"), 3e-308 / 16.0);
}

}  // namespace
}  // namespace rtcf::test
