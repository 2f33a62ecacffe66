// Single components with rtcf/test.hpp, and their declared state.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <utility>

#include "rtcf/component.hpp"
#include "rtcf/test.hpp"

namespace {

enum class Mode { Idle, Run };

struct Pair {
    double a = 0.0;
    double b = 0.0;
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("a", a);
        visit("b", b);
    }
};
struct Renamed {
    double a = 0.0;
    double c = 0.0;
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("a", a);
        visit("c", c);
    }
};

class BenchPi final : public rtcf::Component {
    rtcf::Input<double> setpoint{this, "setpoint"};
    rtcf::Input<double> measured{this, "measured"};
    rtcf::Output<double> effort{this, "effort", "N m", rtcf::Finite()};
    rtcf::Parameter<double> kp{this, "kp", 1.0, rtcf::Min(0.0)};
    rtcf::Parameter<double> limit{this, "limit", 10.0};
    rtcf::Derived<double> half{this};
    rtcf::State<double> integral{this, "integral", 0.0, rtcf::Unit("N m")};
    rtcf::State<Eigen::Vector3d> force{this, "force", Eigen::Vector3d::Zero()};
    rtcf::State<Mode> mode{this, "mode", Mode::Idle};

    bool prepare(const rtcf::Values& proposed) override {
        half.stage(proposed[limit] / 2.0);
        return proposed[limit] > 0.0 || fail("limit {} is not positive", proposed[limit]);
    }
    bool start() override {
        mode = Mode::Run;
        return true;
    }
    void update() override {
        setpoint.read();
        measured.read();
        const double error = setpoint.value() - measured.value();
        integral += error * dt();
        force += Eigen::Vector3d::Ones();
        effort.write(std::clamp(kp * error + integral, -limit.value(), limit.value()));
        RTCF_INFO_ONCE(this, "first error {}", error);
        RTCF_DEVICE_IO(this);
    }
    void safe() noexcept override { effort.write(0.0); }
};

// Writes once in update(), and in takeOver().
class Heir final : public rtcf::Component {
    rtcf::Output<double> out{this, "out", "", rtcf::Finite()};
    bool has_written_ = false;

    void update() override {
        if (!std::exchange(has_written_, true)) out.write(1.0);
    }
    void takeOver(const rtcf::Predecessor& /*previous*/) noexcept override { out.write(2.0); }
};

class TwiceDeclared final : public rtcf::Component {
    rtcf::State<double> one{this, "same", 0.0};
    rtcf::State<float> other{this, "same", 0.0F};
    void update() override {}
};

class TooLarge final : public rtcf::Component {
    rtcf::State<std::array<double, 4096>> one{this, "one", {}};
    rtcf::State<std::array<double, 4097>> other{this, "other", {}};
    void update() override {}
};

}  // namespace

RTCF_COMPONENT(BenchPi, "For rtcf/test.hpp")
RTCF_COMPONENT(Heir, "Writes in takeOver()")

namespace rtcf::test {
namespace {

TEST(State, IsAsLargeAsItsValue) {
    EXPECT_EQ(sizeof(State<double>), sizeof(double));
    EXPECT_EQ(sizeof(State<Eigen::Vector3d>), sizeof(Eigen::Vector3d));
    EXPECT_EQ(sizeof(State<bool>), sizeof(bool));
}

TEST(State, TypesAreDistinguished) {
    EXPECT_EQ(StateType<long>::identity(), StateType<long long>::identity());
    EXPECT_NE(StateType<double>::identity(), StateType<std::int64_t>::identity());
    EXPECT_NE(StateType<float>::identity(), StateType<double>::identity());
    EXPECT_NE(StateType<Pair>::identity(), StateType<Renamed>::identity());
    EXPECT_NE(StateType<Mode>::identity(), StateType<int>::identity());
    using Wide = Eigen::Matrix<double, 2, 3>;
    using Tall = Eigen::Matrix<double, 3, 2>;
    EXPECT_NE(StateType<Wide>::identity(), StateType<Tall>::identity());
    EXPECT_NE((StateType<std::array<double, 2>>::identity()), StateType<Pair>::identity());
}

TEST(State, TypesAndValuesHaveNames) {
    const auto print = [](const auto& value) {
        std::string text;
        StateType<std::decay_t<decltype(value)>>::print(value, text);
        return text;
    };
    EXPECT_EQ(StateType<std::uint8_t>::name(), "uint8");
    EXPECT_EQ(StateType<Mode>::name(), "Mode");
    EXPECT_EQ(StateType<Eigen::Matrix4f>::name(), "float[4x4]");
    EXPECT_EQ((StateType<Eigen::Matrix<float, 2, 3, Eigen::RowMajor>>::name()),
              "float[2x3,RowMajor]");
    EXPECT_EQ(StateType<Eigen::RowVector2d>::name(), "double[1x2]");
    EXPECT_EQ((StateType<std::array<Pair, 2>>::name()), "{a: double, b: double}[2]");
    EXPECT_EQ(print(std::array<Pair, 2>{}), "[{a: 0, b: 0}, {a: 0, b: 0}]");
    EXPECT_EQ(print(Eigen::Vector3d(1.0, 0.1, -2.5)), "[1; 0.1; -2.5]");
    EXPECT_EQ(print(Eigen::Quaterniond::Identity()), "[0, 0, 0, 1]");
    EXPECT_EQ(StateType<Eigen::Isometry3d>::name(), "transform");
}

namespace same {
enum class Mode { Idle, Run };
}
namespace rebuilt {
enum class Mode { Off, Idle, Run };
}
namespace renamed {
enum class Mode { Idle, Go };
}
namespace longer {
enum class Mode { Idle, Run, Fail };
}
namespace loose {
enum Mode { Idle, Run };  // its values depend on its enumerators
}
namespace plain {
enum Mode : int { Idle = 0, Run = 1, Other = 40 };
}

TEST(State, AnEnumIsIdentifiedByItsEnumerators) {
    const std::uint64_t mode = StateType<Mode>::identity();
    EXPECT_EQ(StateType<same::Mode>::identity(), mode);
    EXPECT_EQ(StateType<plain::Mode>::identity(), mode) << "up to 31";
    EXPECT_NE(StateType<rebuilt::Mode>::identity(), mode);
    EXPECT_NE(StateType<renamed::Mode>::identity(), mode);
    EXPECT_NE(StateType<longer::Mode>::identity(), mode);
    EXPECT_NE(StateType<loose::Mode>::identity(), mode);
}

TEST(State, DuplicateOrTooLargeDeclarationIsRejected) {
    EXPECT_THROW(TwiceDeclared(), std::logic_error);
    EXPECT_THROW(TooLarge(), std::logic_error);
}

TEST(Bench, RunsAComponentByHand) {
    Bench pi("BenchPi", {{"kp", 2.0}});
    EXPECT_EQ(pi.read<double>("effort"), nullptr);
    pi.write("setpoint", 1.0);
    pi.write("measured", 0.5);
    pi.cycle(1000);
    EXPECT_NEAR(*pi.read<double>("effort"), 1.5, 1e-9) << "half a second of half an error";
    EXPECT_NEAR(pi.state<double>("integral"), 0.5, 1e-9);
    EXPECT_EQ(pi.state<Eigen::Vector3d>("force"), Eigen::Vector3d(1000.0, 1000.0, 1000.0));
    EXPECT_EQ(pi.state<Mode>("mode"), Mode::Run);
    pi.set({{"limit", 0.25}});
    pi.cycle();
    EXPECT_EQ(*pi.read<double>("effort"), 0.25);
    pi.safe();
    EXPECT_EQ(*pi.read<double>("effort"), 0.0);
    EXPECT_EQ(pi.writes("effort"), 1002U);
    EXPECT_EQ(pi.deviceCalls(), 1001U);
}

TEST(Bench, CountsNonFiniteValues) {
    Bench pi("BenchPi");
    pi.write("setpoint", std::numeric_limits<double>::quiet_NaN());
    pi.cycle();
    EXPECT_EQ(pi.nonFinite(), 1U);
    EXPECT_EQ(pi.read<double>("effort"), nullptr);
}

TEST(Bench, CountsValuesVisibleToReaders) {
    Bench pi("BenchPi");
    pi.write("setpoint", 1.0);
    pi.cycle(3);
    EXPECT_EQ(pi.writes("effort"), 3U);
    pi.write("setpoint", std::numeric_limits<double>::quiet_NaN());
    pi.cycle(2);
    EXPECT_EQ(pi.writes("effort"), 3U);
    pi.write("setpoint", 1.0);
    pi.state<double>("integral") = 0.0;
    pi.cycle();
    EXPECT_EQ(pi.writes("effort"), 4U) << "values between updates are not counted";
    EXPECT_EQ(pi.nonFinite(), 2U);
}

TEST(Bench, ReportsErrors) {
    EXPECT_THROW(Bench("Nothing"), std::invalid_argument);
    EXPECT_THROW(Bench("BenchPi", {{"limit", -1.0}}), std::runtime_error);
    EXPECT_THROW(Bench("BenchPi", {{"kp", -1.0}}), std::invalid_argument);
    Bench pi("BenchPi");
    EXPECT_THROW(pi.write("nothing", 1.0), std::invalid_argument);
    EXPECT_THROW(pi.write("setpoint", 1.0F), std::invalid_argument);
    EXPECT_THROW(pi.read<int>("effort"), std::invalid_argument);
    EXPECT_THROW(pi.state<float>("integral"), std::invalid_argument);
}

TEST(Bench, TransfersState) {
    Bench old("BenchPi");
    old.write("setpoint", 1.0);
    old.cycle(10);
    Bench fresh("BenchPi");
    fresh.takeOver(old);
    EXPECT_EQ(fresh.state<double>("integral"), old.state<double>("integral"));
}

TEST(Bench, PublishesWhatTakeOverWrites) {
    Bench old("Heir");
    Bench fresh("Heir");
    fresh.cycle();
    ASSERT_EQ(*fresh.read<double>("out"), 1.0);
    fresh.takeOver(old);
    fresh.cycle();
    EXPECT_EQ(*fresh.read<double>("out"), 2.0);
    EXPECT_EQ(fresh.writes("out"), 2U);
}

// Each of six joints of one class logs once, and a reloaded one logs again.
TEST(Logging, OnceAppliesToEachComponent) {
    Bench left("BenchPi");
    Bench right("BenchPi");
    left.cycle(3);
    right.cycle(3);
    EXPECT_EQ(left.log(), std::vector<std::string>{"first error 0"});
    EXPECT_EQ(right.log(), left.log());
}

// Without a bench: the object alone.
TEST(Component, WithADeviceNeedsNoExecutor) {
    BenchPi pi;
    static_cast<Component&>(pi).update();
    EXPECT_FALSE(pi.logs(LogLevel::Fatal));
}

}  // namespace
}  // namespace rtcf::test
