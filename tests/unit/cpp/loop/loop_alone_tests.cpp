// A loop with one component, without a runner: events in the middle of a cycle.
#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "common/time_units.hpp"
#include "faults/flight_recorder.hpp"
#include "frames/frame_ring.hpp"
#include "logging/log.hpp"
#include "loop/loop.hpp"
#include "rtcf/component.hpp"
#include "support/eventually.hpp"
#include "support/shifted_counter.hpp"

namespace rtcf::test {
namespace {

using namespace executor;

class LoopAlone : public ::testing::Test {
   protected:
    // Runs the test's function in each cycle.
    class Worker final : public Component {
       public:
        explicit Worker(std::function<void(std::uint64_t)> work) : work_(std::move(work)) {}
        void update() override { work_(iteration()); }

       private:
        std::function<void(std::uint64_t)> work_;
    };

    ~LoopAlone() override {
        loop_.requestStop();
        loop_.join(kSecond);
    }

    void start(std::function<void(std::uint64_t iteration)> work) {
        worker_ = std::make_unique<Worker>(std::move(work));
        context_.full_name = "/worker";
        context_.clock = &loop_.clock();
        context_.recorder_slot = recorder_.addSlot("/worker");
        accessTo(*worker_).attach(context_);
        schedule_.steps.push_back({worker_.get(), updateOf(*worker_), context_.recorder_slot, 1});
        schedule_.turns.push_back({&component_, 0, false});
        schedule_.findStretches();
        if (frames_ == nullptr) {
            frames_ = std::make_unique<FrameRing>(std::vector<FrameRing::Source>{}, 1, 16,
                                                  loop_.counter());
        }
        Adoption adoption;
        adoption.schedule = &schedule_;
        adoption.frames = frames_.get();
        ASSERT_TRUE(loop_.adopt(adoption, kSecond));
        loop_.start(settings_, loop_.stops());
    }

    // After this, the test's objects are no longer used.
    void stop() {
        loop_.requestStop();
        EXPECT_TRUE(eventually([this] { return loop_.join(0); }));
    }

    static void spin(std::int64_t ns) {
        const std::int64_t until = monotonicNow() + ns;
        while (monotonicNow() < until) {
        }
    }

    std::uint64_t iteration() const { return loop_.statistics().iteration.load(); }
    bool reaches(std::uint64_t iteration) {
        return eventually([&] { return this->iteration() >= iteration; });
    }

    LoopSettings settings_;
    FlightRecorder recorder_;
    Log log_{[](LogEntry&&) {}};
    Loop loop_{log_, recorder_, {}};
    ComponentContext context_;
    ComponentStatistics component_;
    Schedule schedule_;
    std::unique_ptr<FrameRing> frames_;
    std::unique_ptr<Worker> worker_;
};

// During a cycle. The counter continues or restarts, CLOCK_MONOTONIC stands still.
class LoopSuspended : public LoopAlone, public ::testing::WithParamInterface<std::int64_t> {};

TEST_P(LoopSuspended, ASuspendNeitherStopsNorStallsTheLoop) {
    if (!ShiftedCounter::possible()) GTEST_SKIP() << "the counter cannot be trapped here";
    constexpr std::int64_t kSlept = 5;  // s
    constexpr std::uint64_t kAt = 50;
    const std::int64_t ticks = loop_.counter().toTicks(GetParam() * kSlept * kSecond);
    ShiftedCounter counter;
    start([&](std::uint64_t iteration) {
        if (iteration == kAt) counter.shift(ticks);
    });
    ASSERT_TRUE(reaches(kAt + 100));
    EXPECT_LT(loop_.statistics().missed.value(), static_cast<std::uint64_t>(kSlept) * 1000)
        << "cycles missed during the suspend";
    stop();
}

INSTANTIATE_TEST_SUITE_P(LoopAlone, LoopSuspended, ::testing::Values(1, -1));

// Tested here, since a runner stops its loop for this only with full real-time rights.
TEST_F(LoopAlone, FullBucketEndsTheLoop) {
    settings_.max_overruns = 3;
    start([](std::uint64_t iteration) {
        if (iteration >= 20) spin(3'000'000);
    });
    ASSERT_TRUE(eventually([this] { return loop_.join(0); }));
    EXPECT_EQ(loop_.fault().kind, LoopFault::Kind::Overruns);
    EXPECT_EQ(loop_.statistics().overruns.value(), 4U);
}

TEST_F(LoopAlone, BucketOfNoSizeIsNeverFull) {
    start([](std::uint64_t iteration) {
        if (iteration >= 20) spin(3'000'000);
    });
    EXPECT_TRUE(reaches(40));
    EXPECT_TRUE(loop_.running());
    stop();
}

// Copies of frames that exceed the cycle.
TEST_F(LoopAlone, FramesAreASeparateCauseOfOverruns) {
    std::vector<std::uint8_t> large(4 * 1024 * 1024);
    frames_ = std::make_unique<FrameRing>(
        std::vector<FrameRing::Source>{{large.data(), large.size()}}, 1, 16, loop_.counter());
    settings_.period_ns = 50'000;
    start([](std::uint64_t) {});
    ASSERT_TRUE(reaches(60));
    stop();
    const LoopStatistics& statistics = loop_.statistics();
    EXPECT_GE(statistics.frame_overruns.value(), 20U);
    // A cycle delayed elsewhere has another cause.
    EXPECT_EQ(statistics.frame_overruns.value() + statistics.exchange_overruns.value() +
                  statistics.late_wake_ups.value() + component_.overruns.value(),
              statistics.overruns.value());
}

}  // namespace
}  // namespace rtcf::test
