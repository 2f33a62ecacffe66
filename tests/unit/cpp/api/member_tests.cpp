// Members that end before their component.
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "rtcf/component.hpp"
#include "rtcf/test.hpp"

namespace rtcf::test {
namespace {

// Ends one of its members, as told.
class Losing : public Component {
   public:
    Losing() {
        in.emplace(this, "in");
        queue.emplace(this, "queue");
        out.emplace(this, "out");
        finite.emplace(this, "finite", "", Finite{});
        state.emplace(this, "state", 1.0);
        parameter.emplace(this, "parameter", 1.0);
        array.emplace(this, "array", std::array<double, 2>{});
        derived.emplace(this);
        mailbox.emplace(this);
    }
    void lose(const std::string& what) {
        if (what == "in") in.reset();
        if (what == "queue") queue.reset();
        if (what == "out") out.reset();
        if (what == "finite") finite.reset();
        if (what == "state") state.reset();
        if (what == "parameter") parameter.reset();
        if (what == "array") array.reset();
        if (what == "derived") derived.reset();
        if (what == "mailbox") mailbox.reset();
    }
    Parameter<std::string> lost{this, "lost", ""};
    std::optional<Input<double>> in;
    std::optional<Queue<double, 4>> queue;
    std::optional<Output<double>> out;
    std::optional<Output<double>> finite;
    std::optional<State<double>> state;
    std::optional<Parameter<double>> parameter;
    std::optional<Parameter<std::array<double, 2>>> array;
    std::optional<Derived<double>> derived;
    std::optional<Mailbox<int, int>> mailbox;

   private:
    bool configure() override {
        lose(lost);
        return true;
    }
    void update() override {}
};

const std::vector<std::string> kMembers{"in",        "queue", "out",     "finite", "state",
                                        "parameter", "array", "derived", "mailbox"};

TEST(Member, AComponentWhoseMemberEndsInConfigureIsRejected) {
    const Bench bench("Losing");
    for (const std::string& member : kMembers) {
        try {
            const Bench lacking("Losing", {{"lost", member}});
            ADD_FAILURE() << member;
        } catch (const std::runtime_error& error) {
            EXPECT_NE(std::string(error.what()).find(" ended before the component"),
                      std::string::npos);
        }
    }
}

TEST(Member, OneThatHasEndedIsInNoList) {
    for (const std::string& member : kMembers) {
        Losing losing;
        const auto access = accessTo(losing);
        access.freeze();
        const auto count = [&] {
            return access.inputs().size() + access.outputs().size() + access.parameters().size() +
                   access.states().size() + access.derived().size() + access.mailboxes().size() +
                   access.stagedOutputs().size();
        };
        const std::size_t before = count();
        losing.lose(member);
        const bool two = member == "finite" || member == "array";  // a list of its own, elements
        EXPECT_EQ(count(), before - (two ? 2 : 1)) << member;
        EXPECT_TRUE(access.ended().empty()) << "after configure() it is not reported";
    }
}

TEST(Member, AnInputOfThatNameMayFollow) {
    Losing losing;
    losing.in.reset();
    losing.in.emplace(&losing, "in");
    EXPECT_EQ(accessTo(losing).ended(), std::vector<std::string>{"input 'in'"});
    EXPECT_EQ(accessTo(losing).inputs().size(), 2U);
}

struct Mixin {
    std::optional<Output<double>> out;
};

class Mixed final : public Mixin, public Component {
   public:
    Mixed() { out.emplace(this, "out"); }

   private:
    void update() override {}
};

// For AddressSanitizer.
TEST(Member, OneOutsideOfItsComponentMayEndLater) {
    auto mixed = std::make_unique<Mixed>();
    EXPECT_EQ(accessTo(*mixed).outputs().size(), 1U);
    mixed.reset();
    std::optional<Input<double>> in;
    {
        Losing losing;
        in.emplace(&losing, "later");
    }
    in.reset();
}

}  // namespace
}  // namespace rtcf::test

RTCF_COMPONENT_NAMED(rtcf::test::Losing, "Losing", "Ends a member", Losing)
