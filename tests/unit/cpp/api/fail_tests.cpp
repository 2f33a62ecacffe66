// The message of a failing hook.
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "rtcf/component.hpp"
#include "rtcf/test.hpp"

namespace rtcf::test {
namespace {

class Failing final : public Component {
    Parameter<int> how{this, "how", 0};
    bool configure() override {
        switch (how.value()) {
            case 0:
                return true;
            case 1:
                return fail("nothing {but} a brace");
            case 2:
                return fail("two {} of {}", 1);
            default:
                return RTCF_FAIL(this, "no reply from {} in {:.1f} s", "drive", 0.25);
        }
    }
    void update() override {}
};

TEST(Fail, HasTheGivenText) {
    const auto errorOf = [](int how) -> std::string {
        try {
            const Bench bench("Failing", {{"how", std::int64_t{how}}});
        } catch (const std::runtime_error& error) {
            return error.what();
        }
        return {};
    };
    EXPECT_EQ(errorOf(0), "");
    EXPECT_EQ(errorOf(1), "configure failed: nothing {but} a brace");
    EXPECT_EQ(errorOf(2), "configure failed: two {} of {}") << "the arguments are formatted";
    EXPECT_EQ(errorOf(3), "configure failed: no reply from drive in 0.2 s");
}

}  // namespace
}  // namespace rtcf::test

RTCF_COMPONENT_NAMED(rtcf::test::Failing, "Failing", "Fails in configure()", Failing)
