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

class Choosy final : public Component {
    Parameter<double> x{this, "x", 0.0};
    Derived<double> twice{this};
    Output<double> out{this, "out"};

    bool prepare(const Values& proposed) override {
        twice.stage(2.0 * proposed[x]);
        if (proposed[x] < 0.0) throw std::runtime_error("x is negative");
        return proposed[x] <= 1.0 || fail("x is at most 1");
    }
    bool start() override { return x.value() < 0.5; }
    void update() override { out.write(*twice); }
};

TEST(Fail, HasNoTextOfAnEarlierHook) {
    Bench bench("Choosy");
    EXPECT_THROW(bench.set({{"x", 5.0}}), std::runtime_error);
    bench.set({{"x", 0.5}});
    try {
        bench.cycle();
        FAIL();
    } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "start failed: it returned false without an error text");
    }
}

TEST(Bench, ARejectedBatchChangesNothingLater) {
    Bench bench("Choosy", {{"x", 0.25}});
    EXPECT_THROW(bench.set({{"x", -1.0}}), std::runtime_error);
    EXPECT_THROW(bench.set({{"y", 1.0}}), std::invalid_argument);
    bench.set({});
    bench.cycle();
    EXPECT_EQ(*bench.read<double>("out"), 0.5);
}

}  // namespace
}  // namespace rtcf::test

RTCF_COMPONENT_NAMED(rtcf::test::Choosy, "Choosy", "Rejects values", Choosy)

RTCF_COMPONENT_NAMED(rtcf::test::Failing, "Failing", "Fails in configure()", Failing)
