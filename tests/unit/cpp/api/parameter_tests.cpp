#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "support/bare_component.hpp"

namespace rtcf::test {
namespace {

using Int = std::int64_t;

class ParameterTest : public ::testing::Test {
   protected:
    ParameterBase& named(const std::string& name) {
        for (ParameterBase* parameter : accessTo(component).parameters())
            if (parameter->declaration().name == name) return *parameter;
        throw std::out_of_range(name);
    }
    // Checks and, if valid, sets. @return the error
    std::string set(const std::string& name, ParameterValue value) {
        ParameterBase& parameter = named(name);
        std::string why = parameter.check(value);
        if (why.empty()) {
            parameter.stage(value);
            parameter.commit();
        }
        return why;
    }
    template <typename T>
    std::string set(const Parameter<T>& parameter, ParameterValue value) {
        return set(parameter.declaration().name, std::move(value));
    }

    BareComponent component;
};

TEST_F(ParameterTest, StartsWithItsDefault) {
    const Parameter<double> gain{&component,  "gain",          1.5, Min(0.0), Max(2.0),
                                 Unit("N/m"), Doc("stiffness")};
    EXPECT_EQ(gain.value(), 1.5);
    const ParameterDeclaration& declaration = gain.declaration();
    EXPECT_EQ(declaration.type, "double");
    EXPECT_EQ(std::get<double>(declaration.default_value), 1.5);
    EXPECT_EQ(declaration.minimum, 0.0);
    EXPECT_EQ(declaration.maximum, 2.0);
    EXPECT_EQ(declaration.unit, "N/m");
    EXPECT_EQ(declaration.doc, "stiffness");
}

TEST_F(ParameterTest, HasAPathOfGroupsAsItsName) {
    const Parameter<double> p{&component, "gains/p", 1.0};
    const Parameter<int> order{&component, "gains/filter/order", 2};
    const Parameter<std::array<double, 2>> k{&component, "gains/k", {1.0, 2.0}};
    const Parameter<double> alike{&component, "gains_p", 3.0};
    EXPECT_EQ(set("gains/p", 4.0), "");
    EXPECT_EQ(set("gains/k_1", 5.0), "");
    EXPECT_EQ(p.value(), 4.0);
    EXPECT_EQ(k[1], 5.0);
    EXPECT_EQ(order.value(), 2);
    EXPECT_EQ(alike.value(), 3.0);
}

TEST_F(ParameterTest, RejectsNamesThatRosHasNot) {
    for (const char* name :
         {"", "/", "/p", "gains/", "gains//p", "gains/2", "gains/_p", "a.b", "ä"}) {
        EXPECT_THROW((Parameter<double>{&component, name, 1.0}), std::logic_error) << name;
    }
    EXPECT_THROW((Output<double>{&component, "gains/p"}), std::logic_error) << "a port";
    EXPECT_TRUE(accessTo(component).parameters().empty());
}

TEST_F(ParameterTest, IsNotAGroupToo) {
    const auto error = [&](const char* name) -> std::string {
        try {
            const Parameter<double> other{&component, name, 1.0};
        } catch (const std::logic_error& found) {
            return found.what();
        }
        return {};
    };
    const Parameter<double> p{&component, "gains/p", 1.0};
    EXPECT_EQ(error("gains"), "'gains' is a parameter and the group of 'gains/p': rename one");
    EXPECT_EQ(error("gains/p/low"),
              "'gains/p' is a parameter and the group of 'gains/p/low': rename one");
    EXPECT_EQ(error("gains/p"), "parameter 'gains/p' is declared twice");
    const Parameter<std::array<double, 2>> k{&component, "k", {}};
    EXPECT_EQ(error("k_1/low"), "'k_1' is a parameter and the group of 'k_1/low': rename one");
    EXPECT_EQ(accessTo(component).parameters().size(), 3U);
}

TEST_F(ParameterTest, ChangesAtCommitOnly) {
    const Parameter<double> gain{&component, "gain", 1.0};
    named("gain").stage(2.0);
    EXPECT_EQ(gain.value(), 1.0);
    EXPECT_EQ(Values{}[gain], 2.0);
    named("gain").commit();
    EXPECT_EQ(gain.value(), 2.0);
}

TEST_F(ParameterTest, IsItsValueAndAPointer) {
    EXPECT_EQ(sizeof(Parameter<double>), sizeof(double) + sizeof(void*));
    const Parameter<double> gain{&component, "gain", 1.0};
    EXPECT_EQ(named("gain").place(), &gain.value());
}

TEST_F(ParameterTest, BoundsAreInclusive) {
    Parameter<double> gain{&component, "gain", 1.0, Min(0.0), Max(2.0)};
    EXPECT_EQ(set(gain, 0.0), "");
    EXPECT_EQ(set(gain, 2.0), "");
    EXPECT_NE(set(gain, std::nextafter(2.0, 3.0)), "");
    EXPECT_NE(set(gain, -1e-300), "");
    EXPECT_EQ(gain.value(), 2.0);
}

TEST_F(ParameterTest, ErrorNamesParameterValueBoundAndUnit) {
    Parameter<double> gain{&component, "gain", 1.0, Min(0.5), Unit("N")};
    EXPECT_EQ(set(gain, 0.25), "parameter gain = 0.25 is below its minimum 0.5 N");
}

TEST_F(ParameterTest, NonFiniteValueIsRejected) {
    Parameter<double> gain{&component, "gain", 1.0};
    EXPECT_NE(set(gain, std::nan("")), "");
    EXPECT_NE(set(gain, std::numeric_limits<double>::infinity()), "");
    EXPECT_NE(set(gain, -std::numeric_limits<double>::infinity()), "");
}

TEST_F(ParameterTest, NonFiniteDefaultMeansNoLimit) {
    const Parameter<double> limit{&component, "limit", std::numeric_limits<double>::infinity()};
    EXPECT_TRUE(std::isinf(limit.value()));
}

TEST_F(ParameterTest, DefaultOutsideItsBoundsIsRejected) {
    const auto declare = [this] {
        const Parameter<double> gain{&component, "gain", 3.0, Max(2.0)};
    };
    EXPECT_THROW(declare(), std::logic_error);
}

TEST_F(ParameterTest, IntegerIsAcceptedForADoubleButNotViceVersa) {
    Parameter<double> gain{&component, "gain", 1.0};
    Parameter<Int> count{&component, "count", 1};
    EXPECT_EQ(set(gain, Int{3}), "");
    EXPECT_EQ(gain.value(), 3.0);
    EXPECT_EQ(set(count, 3.0), "parameter count takes an int, not a double");
}

TEST_F(ParameterTest, OtherTypesAreRejected) {
    Parameter<bool> enabled{&component, "enabled", true};
    Parameter<std::string> device{&component, "device", "none"};
    EXPECT_EQ(set(enabled, Int{0}), "parameter enabled takes a bool, not an int");
    EXPECT_EQ(set(device, true), "parameter device takes a string, not a bool");
    EXPECT_EQ(set(enabled, false), "");
    EXPECT_EQ(set(device, std::string("can0")), "");
    EXPECT_FALSE(enabled.value());
    EXPECT_EQ(device.value(), "can0");
}

TEST_F(ParameterTest, IntegersOfOtherWidthsAreNarrowed) {
    Parameter<std::int8_t> small{&component, "small", std::int8_t{1}};
    EXPECT_EQ(set(small, Int{127}), "");
    EXPECT_NE(set(small, Int{128}), "");
    EXPECT_NE(set(small, Int{-129}), "");
    Parameter<std::uint16_t> port{&component, "port", std::uint16_t{80}, Max(1e9)};
    EXPECT_NE(set(port, Int{-1}), "");
    EXPECT_NE(set(port, Int{65536}), "");
    EXPECT_EQ(set(port, Int{65535}), "");
    EXPECT_EQ(port.value(), 65535);
    Parameter<std::uint64_t> large{&component, "large", std::uint64_t{1}};
    EXPECT_NE(set(large, Int{-1}), "");
    EXPECT_EQ(set(large, std::numeric_limits<Int>::max()), "");
}

TEST_F(ParameterTest, FloatRejectsADoubleBeyondItsRange) {
    Parameter<float> gain{&component, "gain", 1.0F};
    EXPECT_NE(set(gain, 1e39), "");
    EXPECT_EQ(set(gain, 1e38), "");
    EXPECT_EQ(gain.value(), 1e38F);
}

enum class Drive { Off = 3, Slow = 7, Fast = 1 };

TEST_F(ParameterTest, EnumeratorIsSentByName) {
    Parameter<Drive> mode{&component,
                          "mode",
                          Drive::Slow,
                          Choice("off", Drive::Off),
                          Choice("slow", Drive::Slow),
                          Choice("fast", Drive::Fast)};
    EXPECT_EQ(mode.declaration().type, "enum");
    EXPECT_EQ(std::get<std::string>(mode.declaration().default_value), "slow");
    EXPECT_EQ(set(mode, std::string("fast")), "");
    EXPECT_EQ(mode.value(), Drive::Fast);
    EXPECT_EQ(set(mode, std::string("warp")), "parameter mode = warp is none of off, slow, fast");
    EXPECT_EQ(set(mode, Int{1}), "parameter mode takes a name, not an int");
    EXPECT_EQ(mode.value(), Drive::Fast);
}

TEST_F(ParameterTest, EnumDefaultWithoutAChoiceIsRejected) {
    const auto declare = [this] {
        const Parameter<Drive> mode{&component, "mode", Drive::Off, Choice("fast", Drive::Fast)};
    };
    EXPECT_THROW(declare(), std::logic_error);
}

TEST_F(ParameterTest, DuplicateDeclarationIsRejected) {
    const Parameter<double> gain{&component, "gain", 1.0};
    const auto again = [this] { const Parameter<bool> other{&component, "gain", true}; };
    EXPECT_THROW(again(), std::logic_error);
}

TEST_F(ParameterTest, ElementsOfAnArrayAreParameters) {
    const Parameter<std::array<double, 3>> gains{&component, "gains",     {1.0, 2.0, 3.0},
                                                 Min(0.0),   Unit("N/m"), Doc("stiffness")};
    ASSERT_EQ(accessTo(component).parameters().size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
        const ParameterDeclaration& element = accessTo(component).parameters()[i]->declaration();
        EXPECT_EQ(element.name, "gains_" + std::to_string(i));
        EXPECT_EQ(element.type, "double");
        EXPECT_EQ(std::get<double>(element.default_value), static_cast<double>(i + 1));
        EXPECT_EQ(element.minimum, 0.0);
        EXPECT_EQ(element.unit, "N/m");
        EXPECT_EQ(element.doc, "stiffness");
    }
    EXPECT_EQ(set("gains_1", -0.5), "parameter gains_1 = -0.5 is below its minimum 0 N/m");
    EXPECT_EQ(set("gains_1", Int{7}), "");
    const std::array<double, 3>& values = gains;
    EXPECT_EQ(values, (std::array<double, 3>{1.0, 7.0, 3.0}));
    EXPECT_EQ(gains[1], 7.0);
}

TEST_F(ParameterTest, AnArrayIsDeclaredWholeOrNotAtAll) {
    const Parameter<double> taken{&component, "gains_2", 1.0};
    const auto declare = [this] {
        const Parameter<std::array<double, 3>> gains{&component, "gains", {1.0, 2.0, 3.0}};
    };
    EXPECT_THROW(declare(), std::logic_error);
    ASSERT_EQ(accessTo(component).parameters().size(), 1U);
    EXPECT_EQ(accessTo(component).parameters()[0]->declaration().name, "gains_2");
}

TEST_F(ParameterTest, AVectorHasItsElementsAndTheirNumber) {
    const Parameter<BoundedVector<double, 4>> taps{&component, "taps", {1.0, 2.0}, Min(0.5)};
    ASSERT_EQ(accessTo(component).parameters().size(), 5U);
    EXPECT_EQ(std::vector<double>(taps.begin(), taps.end()), (std::vector<double>{1.0, 2.0}));
    EXPECT_EQ(std::get<double>(named("taps_3").declaration().default_value), 2.0)
        << "within the bounds";
    EXPECT_EQ(named("taps_size").declaration().vectorName(), "taps");
    EXPECT_EQ(named("taps_size").declaration().maximum, 4.0);
    EXPECT_EQ(set("taps_size", Int{5}), "parameter taps_size = 5 is above its maximum 4 ");
    EXPECT_EQ(set("taps_2", 7.0), "");
    EXPECT_EQ(taps.size(), 2U);
    EXPECT_EQ(set("taps_size", Int{3}), "");
    EXPECT_EQ(std::vector<double>(taps.begin(), taps.end()), (std::vector<double>{1.0, 2.0, 7.0}));
    named("taps_size").stage(Int{1});
    named("taps_0").stage(3.0);
    const BoundedVector<double, 4>& proposed = Values{}[taps];
    EXPECT_EQ(std::vector<double>(proposed.begin(), proposed.end()), std::vector<double>{3.0});
    EXPECT_EQ(taps.size(), 3U) << "not committed";
}

TEST_F(ParameterTest, AVectorIsDeclaredWholeOrNotAtAll) {
    const Parameter<int> taken{&component, "taps_size", 1};
    const auto declare = [this] {
        const Parameter<BoundedVector<double, 3>> taps{&component, "taps", {1.0}};
    };
    EXPECT_THROW(declare(), std::logic_error);
    EXPECT_EQ(accessTo(component).parameters().size(), 1U);
    const auto many = [] { const BoundedVector<int, 2> vector{1, 2, 3}; };
    EXPECT_THROW(many(), std::length_error);
}

TEST_F(ParameterTest, AnEmptyVectorTakesElementsLater) {
    const Parameter<BoundedVector<std::string, 2>> names{&component, "names", {}};
    EXPECT_TRUE(names.empty());
    EXPECT_EQ(set("names_0", std::string("left")), "");
    EXPECT_EQ(set("names_size", Int{1}), "");
    EXPECT_EQ(names[0], "left");
    const Parameter<BoundedVector<int, 2>> limits{&component, "limits", {}, Min(1.5), Max(9.0)};
    EXPECT_EQ(set("limits_size", Int{1}), "");
    EXPECT_EQ(limits[0], 2) << "valid";
    enum class Mode { Idle = 3, Run };
    const Parameter<BoundedVector<Mode, 2>> modes{
        &component, "modes", {}, Choice("idle", Mode::Idle), Choice("run", Mode::Run)};
    EXPECT_EQ(std::get<std::string>(named("modes_1").declaration().default_value), "idle");
}

TEST_F(ParameterTest, AnArrayIsARange) {
    const Parameter<std::array<double, 3>> gains{&component, "gains", {1.0, 2.0, 3.0}};
    double sum = 0.0;
    for (const double gain : gains) sum += gain;
    EXPECT_EQ(sum, 6.0);
    EXPECT_EQ(gains.size(), 3U);
    // The proposed values outlive the expression.
    named("gains_2").stage(5.0);
    const double& last = Values{}[gains][2];
    (void)gains.proposed();
    EXPECT_EQ(last, 5.0);
}

TEST_F(ParameterTest, ElementsOfAnArrayChangeTogether) {
    const Parameter<std::array<int, 2>> limits{&component, "limits", {-1, 1}, Max(10)};
    named("limits_0").stage(Int{-5});
    named("limits_1").stage(Int{5});
    EXPECT_EQ(limits.value(), (std::array<int, 2>{-1, 1}));
    EXPECT_EQ(Values{}[limits], (std::array<int, 2>{-5, 5}));
    for (ParameterBase* parameter : accessTo(component).parameters()) parameter->commit();
    EXPECT_EQ(limits.value(), (std::array<int, 2>{-5, 5}));
    named("limits_0").stage(Int{-7});
    named("limits_0").release();
    EXPECT_EQ(limits.proposed(), (std::array<int, 2>{-5, 5}));
    // Nor does a value that was staged and released return with the next one.
    named("limits_1").stage(Int{6});
    EXPECT_EQ(limits.proposed(), (std::array<int, 2>{-5, 6}));
}

// A callback of ROS or a driver's thread copies while the graph thread stages and the cycle thread
// commits.
TEST_F(ParameterTest, AnotherThreadCopiesWholeValues) {
    constexpr std::size_t kLong = 60;  // beyond the characters that std::string keeps in itself
    constexpr std::size_t kName = 3 * kLong;
    constexpr int kChanges = 3000;
    const Parameter<double> gain{&component, "gain", 0.0};
    const Parameter<std::string> frame{&component, "frame", std::string(kLong, 'a')};
    const Parameter<std::array<double, 3>> gains{&component, "gains", {}};
    const Parameter<BoundedVector<std::string, 3>> names{&component, "names", {}};
    std::atomic<bool> changing{true};
    std::atomic<int> copies{0};
    int torn = 0;
    std::thread reader([&] {
        do {
            const std::string text = frame.copy();
            const bool is_long = text.find_first_not_of('a') == std::string::npos;
            const bool is_short = text.find_first_not_of('b') == std::string::npos;
            const bool whole =
                (is_long && text.size() == kLong) || (is_short && text.size() == kLong / 2);
            if (!whole) ++torn;
            const std::array<double, 3> array = gains.copy();
            if (array[0] != array[1] || array[0] != array[2]) ++torn;
            for (const std::string& name : names.copy()) {
                if (name.size() != kName) ++torn;
            }
            const double number = gain.copy();
            if (number != std::floor(number)) ++torn;
            ++copies;
        } while (changing);
    });
    for (int i = 0; i < kChanges || copies < 100; ++i) {
        const auto number = static_cast<double>(i);
        const std::size_t size = static_cast<std::size_t>(i) % 3 + 1;
        named("gain").stage(number);
        named("frame").stage(i % 2 == 0 ? std::string(kLong / 2, 'b') : std::string(kLong, 'a'));
        for (const char* name : {"gains_0", "gains_1", "gains_2"}) named(name).stage(number);
        for (std::size_t k = 0; k < size; ++k)
            named("names_" + std::to_string(k)).stage(std::string(kName, 'c'));
        named("names_size").stage(static_cast<Int>(size));
        for (ParameterBase* parameter : accessTo(component).parameters()) {
            if (parameter->staged()) parameter->commit();
        }
    }
    changing = false;
    reader.join();
    EXPECT_EQ(torn, 0);
    EXPECT_EQ(gains.value(), gains.copy());
    EXPECT_EQ(frame.value(), frame.copy());
}

}  // namespace
}  // namespace rtcf::test
