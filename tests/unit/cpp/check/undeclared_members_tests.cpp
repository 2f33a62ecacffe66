// Undeclared members that a component changes are found by their offsets.
#include "check/undeclared_members.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "rtcf/component.hpp"

namespace rtcf::test {
namespace {

class Forgetful final : public Component {
   public:
    Input<double> in{this, "in"};
    State<double> declared{this, "declared", 0.0};
    std::int64_t count = 0;
    double constant = 5.0;
    Output<double> out{this, "out"};
    Parameter<double> gain{this, "gain", 1.0};
    double last[2] = {0.0, 0.0};
    bool odd = false;

    void update() override {
        ++declared;
        out.write(declared);
    }
};

class UndeclaredMembers : public ::testing::Test {
   protected:
    ComponentContext context_;
    const std::unique_ptr<Forgetful> component{detail::construct<Forgetful>(&context_)};
};

TEST_F(UndeclaredMembers, AreNotPortsAndStates) {
    executor::UndeclaredMembers members(*component);
    for (int i = 0; i < 5; ++i) {
        component->in.read();
        component->update();
        members.look();
    }
    EXPECT_TRUE(members.found().empty());
}

TEST_F(UndeclaredMembers, AreNamedByTheirNeighbours) {
    executor::UndeclaredMembers members(*component);
    ++component->count;
    members.look();
    component->last[0] = component->last[1] = 0.5;
    members.look();
    component->odd = true;
    members.look();
    component->odd = false;  // even if it ends with its first value
    members.look();
    const auto found = members.found();
    ASSERT_EQ(found.size(), 2U);
    EXPECT_EQ(found[0].rfind("8 bytes at offset ", 0), 0U) << found[0];
    EXPECT_NE(found[0].find(", after state declared"), std::string::npos) << found[0];
    EXPECT_EQ(found[1].rfind("24 bytes at offset ", 0), 0U) << found[1];
    EXPECT_NE(found[1].find(", after parameter gain"), std::string::npos) << found[1];
}

}  // namespace
}  // namespace rtcf::test
