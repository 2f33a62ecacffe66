// Declared parameters in dynamic_reconfigure's format.
#include <limits>
#include <optional>

#include "ros/reconfigure/reconfigure_messages.hpp"
#include "ros_fixture.hpp"

namespace {

using rtcf::executor::ParameterBatch;
using rtcf::executor::ParameterSet;
using rtcf::ros1::batchOf;
using rtcf::ros1::descriptionOf;
using rtcf::ros1::valuesOf;

constexpr std::int64_t kBeyond = 5'000'000'000;  // beyond 32 bits
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A set with one integer of that value.
ParameterSet integer(std::int64_t value, std::optional<double> minimum = {},
                     std::optional<double> maximum = {}) {
    rtcf::ParameterDeclaration declaration;
    declaration.name = "count";
    declaration.type = "int";
    declaration.default_value = std::int64_t{1};
    declaration.minimum = minimum;
    declaration.maximum = maximum;
    ParameterSet set;
    set.full_name = "/C";
    set.parameters.push_back({declaration, value});
    return set;
}

std::string typeShown(const ParameterSet& set) {
    return descriptionOf(set).groups.at(0).parameters.at(0).type;
}

TEST(Reconfigure, AnIntegerWithoutBoundsIsShownUnchanged) {
    const ParameterSet set = integer(kBeyond);
    const auto values = valuesOf(set);
    EXPECT_TRUE(values.ints.empty());
    ASSERT_EQ(values.doubles.size(), 1U);
    EXPECT_EQ(values.doubles[0].value, 5e9);
    EXPECT_EQ(typeShown(set), "double");
    const auto description = descriptionOf(set);
    ASSERT_EQ(description.max.doubles.size(), 1U);
    EXPECT_EQ(description.max.doubles[0].value, kInfinity);
    ASSERT_EQ(description.min.doubles.size(), 1U);
    EXPECT_EQ(description.min.doubles[0].value, -kInfinity);
    ASSERT_EQ(description.dflt.doubles.size(), 1U);
    EXPECT_EQ(description.dflt.doubles[0].value, 1.0);
    // Sending it back changes nothing.
    EXPECT_TRUE(batchOf(values, set).empty());
}

TEST(Reconfigure, AnIntegerWithoutBoundsIsSetBeyond32Bits) {
    const ParameterSet set = integer(7);
    auto asked = valuesOf(set);
    ASSERT_EQ(asked.doubles.size(), 1U);
    asked.doubles[0].value = -5e9;
    const ParameterBatch expected{{"count", rtcf::ParameterValue(-kBeyond)}};
    EXPECT_EQ(batchOf(asked, set), expected);
}

TEST(Reconfigure, ASingleBoundDoesNotLimitAnIntegerTo32Bits) {
    EXPECT_EQ(typeShown(integer(7, 0.0, std::nullopt)), "double");
    EXPECT_EQ(valuesOf(integer(kBeyond, 0.0, std::nullopt)).doubles.at(0).value, 5e9);
    EXPECT_EQ(typeShown(integer(7, std::nullopt, 10.0)), "double");
    EXPECT_EQ(valuesOf(integer(-kBeyond, std::nullopt, 10.0)).doubles.at(0).value, -5e9);
    // Two bounds do.
    const ParameterSet bounded = integer(7, 0.0, 10.0);
    EXPECT_EQ(typeShown(bounded), "int");
    EXPECT_EQ(valuesOf(bounded).ints.at(0).value, 7);
    EXPECT_EQ(typeShown(integer(7, 0.0, 5e9)), "double");
}

class ReconfigureTest : public RosFixture {
   protected:
    // A component with an enum, as declared by a library.
    void serveModes(const std::vector<std::string>& names) {
        auto set = std::make_shared<ParameterSet>();
        set->full_name = "/C";
        rtcf::ParameterDeclaration declaration;
        declaration.name = "mode";
        declaration.type = "enum";
        declaration.default_value = std::string("idle");
        int value = 0;
        for (const std::string& name : names) declaration.choices.emplace_back(name, value++);
        set->parameters.push_back({declaration, std::string("idle")});
        auto table = std::make_shared<rtcf::executor::BridgeTable>();
        table->parameters.push_back(set);
        rosNode().setTable(table);
    }
    // Whether the description for a new peer contains the text.
    bool told(const std::string& text) {
        return run({"rostopic", "echo", "-n1", "/C/parameter_descriptions"}).find(text) !=
               std::string::npos;
    }
};

TEST_F(ReconfigureTest, ChoicesOfAReplacedTypeAreSentAgain) {
    startMaster();
    startNode();
    serveModes({"idle", "run"});
    ASSERT_TRUE(eventually([&] { return told("'run'"); }, 60s));
    // Rebuilt with the same names and values except one.
    serveModes({"idle", "walk"});
    EXPECT_TRUE(eventually([&] { return told("'walk'"); }, 60s));
    EXPECT_FALSE(told("'run'"));
}

}  // namespace
