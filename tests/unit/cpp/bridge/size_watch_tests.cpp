// Reports of messages that were too large.
#include "bridge/size_watch.hpp"

#include <gtest/gtest.h>
#include <std_msgs/String.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::test {
namespace {

using executor::Injector;
using executor::SizeWatch;

constexpr std::int64_t kMinute = 60'000'000'000;  // ns

class SizeWatchTest : public testing::Test {
   protected:
    void look(const std::shared_ptr<Injector>& injector) {
        watch_.look({}, {{"/x", injector}}, 16, now_ += kMinute);
    }
    static void lose(Injector& injector, int messages) {
        injector.setLargest(16);
        for (int i = 0; i < messages; ++i) EXPECT_FALSE(injector.admits(17));
    }

    std::vector<std::string> said_;
    SizeWatch watch_{"arm", [this](const std::string& line) { said_.push_back(line); }};

   private:
    std::int64_t now_ = 0;
};

TEST_F(SizeWatchTest, ReportsMessagesLostSinceTheLastReport) {
    const auto injector = std::make_shared<Injector>("/x", typeInfo<std_msgs::String>());
    lose(*injector, 2);
    look(injector);
    look(injector);
    lose(*injector, 3);
    look(injector);
    ASSERT_EQ(said_.size(), 2U);
    EXPECT_EQ(said_[0].find("/x: 2 messages larger than"), 0U) << said_[0];
    EXPECT_EQ(said_[1].find("/x: 3 messages larger than"), 0U) << said_[1];
    EXPECT_EQ(watch_.total(), 5U);
}

TEST_F(SizeWatchTest, CountsFromZeroForANewConnectionAtTheSameAddress) {
    // The next injector uses the memory of the removed one.
    std::optional<Injector> place;
    for (int turn = 1; turn <= 3; ++turn) {
        place.emplace("/x", typeInfo<std_msgs::String>());
        lose(*place, 2);
        look(std::shared_ptr<Injector>(&*place, [](Injector*) {}));
        EXPECT_EQ(watch_.total(), 2U * turn);
    }
    EXPECT_EQ(said_.size(), 3U);
}

TEST_F(SizeWatchTest, ContinuesCountingAConnectionThatReturns) {
    const auto injector = std::make_shared<Injector>("/x", typeInfo<std_msgs::String>());
    lose(*injector, 2);
    look(injector);
    watch_.look({}, {}, 16, 0);
    look(injector);
    EXPECT_EQ(watch_.total(), 2U);
    EXPECT_EQ(said_.size(), 1U);
}

}  // namespace
}  // namespace rtcf::test
