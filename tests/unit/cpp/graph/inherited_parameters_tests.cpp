// Arrays of parameters are kept as a whole or not at all.
#include "graph/inherited_parameters.hpp"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <string>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::test {
namespace {

using executor::InheritedParameter;
using executor::inheritedParameters;
using executor::KeptParameters;

template <typename Member>
class With final : public Component {
   public:
    template <typename... Arguments>
    explicit With(const Arguments&... arguments) : member(this, arguments...) {}
    Member member;

   private:
    void update() override {}
};

template <std::size_t N>
using Taps = With<Parameter<BoundedVector<double, N>>>;
template <std::size_t N>
using Gains = With<Parameter<std::array<double, N>>>;
using Settings = std::vector<std::pair<std::string, ParameterValue>>;

// Inherited parameters of these names and values, all of them chosen.
std::vector<InheritedParameter> of(const Settings& settings) {
    std::vector<InheritedParameter> inherited;
    for (const auto& [name, value] : settings) inherited.push_back({name, value, true});
    return inherited;
}

std::vector<InheritedParameter> taps(std::size_t capacity, const std::vector<double>& values) {
    Settings settings;
    for (std::size_t i = 0; i < capacity; ++i)
        settings.emplace_back("taps_" + std::to_string(i), i < values.size() ? values[i] : 7.0);
    settings.emplace_back("taps_size", static_cast<std::int64_t>(values.size()));
    return of(settings);
}

KeptParameters kept(const std::vector<InheritedParameter>& inherited, const Component& by,
                    const Settings& given = {}) {
    return inheritedParameters(inherited, accessTo(by).parameters(), given, "p/T");
}

std::map<std::string, ParameterValue> values(const KeptParameters& of) {
    return {of.kept.begin(), of.kept.end()};
}

TEST(InheritedParameters, AVectorThatFitsIsKept) {
    const Taps<8> wide("taps", BoundedVector<double, 8>{1.0});
    const auto found = kept(taps(5, {0.2, 0.3, 0.5}), wide);
    EXPECT_EQ(values(found).at("taps_size"), ParameterValue(std::int64_t{3}));
    EXPECT_EQ(values(found).at("taps_2"), ParameterValue(0.5));
    EXPECT_TRUE(found.notes.empty());
}

TEST(InheritedParameters, ElementsBehindTheEndOfAVectorDoNotMatter) {
    const Taps<3> narrow("taps", BoundedVector<double, 3>{1.0});
    const auto found = kept(taps(5, {0.2, 0.3, 0.5}), narrow);
    EXPECT_EQ(values(found).at("taps_size"), ParameterValue(std::int64_t{3}));
    EXPECT_EQ(values(found).size(), 4U);
    EXPECT_TRUE(found.notes.empty());
}

TEST(InheritedParameters, AVectorThatDoesNotFitIsNotKeptInPart) {
    const Taps<3> narrow("taps", BoundedVector<double, 3>{1.0});
    const auto found = kept(taps(5, {0.2, 0.2, 0.2, 0.2, 0.2}), narrow);
    EXPECT_TRUE(found.kept.empty());
    EXPECT_EQ(found.notes,
              std::vector<std::string>{"parameter taps = [0.2, 0.2, 0.2, 0.2, 0.2] is not "
                                       "kept: it has 3 elements at most now"});
    const Taps<5> bounded("taps", BoundedVector<double, 5>{1.0}, Min(0.3));
    const auto low = kept(taps(5, {0.4, 0.2}), bounded);
    EXPECT_TRUE(low.kept.empty());
    ASSERT_EQ(low.notes.size(), 1U);
    EXPECT_NE(low.notes[0].find("parameter taps = [0.4, 0.2] is not kept: parameter taps_1"),
              std::string::npos)
        << low.notes[0];
}

TEST(InheritedParameters, AnArrayOfAnotherLengthIsNotKept) {
    const auto three = of({{"gains_0", 1.5}, {"gains_1", 2.5}, {"gains_2", 3.5}});
    EXPECT_EQ(kept(three, Gains<3>("gains", std::array<double, 3>{})).kept.size(), 3U);
    for (const auto& found : {kept(three, Gains<2>("gains", std::array<double, 2>{})),
                              kept(three, Gains<4>("gains", std::array<double, 4>{})),
                              kept(three, Taps<8>("gains", BoundedVector<double, 8>{1.0})),
                              kept(three, With<Parameter<double>>("gains", 1.0))}) {
        EXPECT_TRUE(found.kept.empty());
        ASSERT_EQ(found.notes.size(), 1U);
        EXPECT_EQ(found.notes[0].find("parameter gains = [1.5, 2.5, 3.5] is not kept: "), 0U);
    }
}

TEST(InheritedParameters, AChosenValueComesFirst) {
    const Gains<2> two("gains", std::array<double, 2>{});
    const auto three = of({{"gains_0", 1.5}, {"gains_1", 2.5}, {"gains_2", 3.5}});
    const auto found = kept(three, two, {{"gains_0", 5.0}, {"gains_1", 6.0}});
    EXPECT_TRUE(found.kept.empty());
    EXPECT_TRUE(found.notes.empty()) << "all of them are chosen";
    const auto fits = of({{"gains_0", 1.5}, {"gains_1", 2.5}});
    EXPECT_EQ(values(kept(fits, two, {{"gains_0", 5.0}})),
              (std::map<std::string, ParameterValue>{{"gains_1", 2.5}}));
}

TEST(InheritedParameters, NamesWithNumbersAreNoArrays) {
    const With<Parameter<double>> one("joint_1", 0.0);
    const auto found =
        kept(of({{"joint_1", 1.0}, {"joint_2", 2.0}, {"window_size", std::int64_t{4}}}), one);
    EXPECT_EQ(values(found), (std::map<std::string, ParameterValue>{{"joint_1", 1.0}}));
    EXPECT_EQ(found.notes.size(), 2U);
}

}  // namespace
}  // namespace rtcf::test
