#include "trajectory/polynomial_segment.hpp"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace rtcf::test
