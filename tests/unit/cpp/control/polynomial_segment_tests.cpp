#include "trajectory/polynomial_segment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "control/random_tasks.hpp"

namespace rtcf::test {
namespace {

using namespace rtcf_control;

constexpr Motion kBegin{1.0, 0.5, -2.0};
constexpr Motion kEnd{3.0, -1.0, 0.7};
constexpr double kDuration = 1.7;

void expectNear(const Motion& motion, const Motion& expected, PointKind kind) {
    EXPECT_NEAR(motion.position, expected.position, 1e-12);
    if (kind >= PointKind::PositionVelocity) {
        EXPECT_NEAR(motion.velocity, expected.velocity, 1e-12);
    }
    if (kind >= PointKind::PositionVelocityAcceleration) {
        EXPECT_NEAR(motion.acceleration, expected.acceleration, 1e-11);
    }
}

TEST(PolynomialSegment, PassesThroughBothPoints) {
    for (const PointKind kind : {PointKind::Position, PointKind::PositionVelocity,
                                 PointKind::PositionVelocityAcceleration}) {
        const PolynomialSegment segment(kBegin, kEnd, kind, kDuration);
        expectNear(segment.at(0.0), kBegin, kind);
        expectNear(segment.at(kDuration), kEnd, kind);
        EXPECT_EQ(segment.at(kDuration).position, kEnd.position);
        expectNear(segment.at(-1.0), kBegin, kind);
        expectNear(segment.at(2.0 * kDuration), kEnd, kind);
    }
}

TEST(PolynomialSegment, HasMatchingDerivatives) {
    for (const PointKind kind : {PointKind::Position, PointKind::PositionVelocity,
                                 PointKind::PositionVelocityAcceleration}) {
        const PolynomialSegment segment(kBegin, kEnd, kind, kDuration);
        const double h = 1e-5;
        for (int i = 1; i < 16; ++i) {
            const double time = i * kDuration / 16.0;
            const Motion before = segment.at(time - h);
            const Motion now = segment.at(time);
            const Motion after = segment.at(time + h);
            EXPECT_NEAR(now.velocity, (after.position - before.position) / (2.0 * h), 1e-7);
            EXPECT_NEAR(now.acceleration, (after.velocity - before.velocity) / (2.0 * h), 1e-7);
        }
    }
}

TEST(PolynomialSegment, IsALineBetweenPositions) {
    const PolynomialSegment segment(kBegin, kEnd, PointKind::Position, 4.0);
    EXPECT_DOUBLE_EQ(segment.at(1.0).position, 1.5);
    EXPECT_DOUBLE_EQ(segment.at(1.0).velocity, 0.5);
    EXPECT_EQ(segment.at(1.0).acceleration, 0.0);
}

TEST(PolynomialSegment, TakesTheAnalyticCourseFromRestToRest) {
    // Velocity in the middle: 3/2 and 15/8 of the mean one.
    const PolynomialSegment cubic({}, {2.0, 0.0, 0.0}, PointKind::PositionVelocity, 4.0);
    EXPECT_DOUBLE_EQ(cubic.at(2.0).position, 1.0);
    EXPECT_DOUBLE_EQ(cubic.at(2.0).velocity, 0.75);
    const PolynomialSegment quintic({}, {2.0, 0.0, 0.0}, PointKind::PositionVelocityAcceleration,
                                    4.0);
    EXPECT_DOUBLE_EQ(quintic.at(2.0).position, 1.0);
    EXPECT_DOUBLE_EQ(quintic.at(2.0).velocity, 15.0 / 16.0);
    EXPECT_NEAR(quintic.at(2.0).acceleration, 0.0, 1e-15);
}

TEST(PolynomialSegment, StepsIfItHasNoDuration) {
    for (const double duration : {0.0, -1.0}) {
        const PolynomialSegment segment(kBegin, kEnd, PointKind::PositionVelocity, duration);
        EXPECT_EQ(segment.at(0.0).position, kEnd.position);
        EXPECT_EQ(segment.at(1.0).position, kEnd.position);
        EXPECT_EQ(segment.at(0.0).velocity, 0.0);
    }
}

TEST(PolynomialSegment, UsesWhatBothPointsGive) {
    EXPECT_EQ(commonKind(PointKind::Position, PointKind::PositionVelocityAcceleration),
              PointKind::Position);
    EXPECT_EQ(commonKind(PointKind::PositionVelocityAcceleration, PointKind::PositionVelocity),
              PointKind::PositionVelocity);
}

TEST(PolynomialSegment, KnowsWhetherItStaysWithinLimits) {
    std::mt19937_64 random(5);
    const auto between = [&](double low, double high) {
        return std::uniform_real_distribution<double>(low, high)(random);
    };
    int within = 0;
    for (int n = 0; n < kTasks; ++n) {
        const double duration = std::pow(10.0, between(-2.0, 1.0));
        const auto motion = [&] {
            return Motion{between(-1.0, 1.0), between(-2.0, 2.0) / duration,
                          between(-5.0, 5.0) / (duration * duration)};
        };
        const auto kind = static_cast<PointKind>(n % 3);
        const PolynomialSegment segment(motion(), motion(), kind, duration);
        PositionRange range{segment.at(0.0).position, segment.at(0.0).position};
        double fastest = 0.0;
        constexpr int kSamples = 2000;
        for (int i = 0; i <= kSamples; ++i) {
            const Motion now = segment.at(i * duration / kSamples);
            range.add(now.position);
            fastest = std::max(fastest, std::abs(now.velocity));
        }
        // Samples miss an extreme by less than a millionth of the change.
        const double size = 1e-5 * (1.0 + fastest * duration);
        const PositionRange wide{range.lower - size, range.upper + size};
        ASSERT_TRUE(segment.staysWithin(wide, fastest + size / duration));
        ASSERT_FALSE(segment.staysWithin({range.lower + size, wide.upper}, 2.0 * fastest));
        ASSERT_FALSE(segment.staysWithin({wide.lower, range.upper - size}, 2.0 * fastest));
        ASSERT_FALSE(segment.staysWithin(wide, fastest - size / duration));
        const PositionRange any{between(-1.5, 0.0), between(0.0, 1.5)};
        within += segment.staysWithin(any, between(0.0, 5.0) / duration) ? 1 : 0;
    }
    EXPECT_GT(within, kTasks / 30);
    EXPECT_TRUE(PolynomialSegment(kBegin, kEnd, PointKind::PositionVelocity, 0.0)
                    .staysWithin({kEnd.position, kEnd.position}, 0.0));
}

}  // namespace
}  // namespace rtcf::test
