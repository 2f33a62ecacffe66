#include "trajectory/trajectory_points.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>

namespace rtcf::test {
namespace {

using namespace rtcf_control;

constexpr std::int64_t kSecond = 1'000'000'000;

// A point of two joints at rest.
void append(TrajectoryPoints& points, std::int64_t time, double position) {
    Motion* const motions = points.append(time, PointKind::PositionVelocity);
    motions[0] = {position, 0.0, 0.0};
    motions[1] = {-position, 0.0, 0.0};
}

TEST(TrajectoryPoints, MovesFromPointToPoint) {
    TrajectoryPoints points(2);
    EXPECT_TRUE(points.empty());
    append(points, 0, 1.0);
    EXPECT_EQ(points.at(1, 5).position, -1.0);
    append(points, kSecond, 2.0);
    append(points, 3 * kSecond, 4.0);
    EXPECT_EQ(points.at(0, 0).position, 1.0);
    EXPECT_DOUBLE_EQ(points.at(0, kSecond / 2).position, 1.5);
    EXPECT_DOUBLE_EQ(points.at(0, kSecond / 2).velocity, 1.5);
    EXPECT_EQ(points.at(0, kSecond).position, 2.0);
    EXPECT_DOUBLE_EQ(points.at(1, 2 * kSecond).position, -3.0);
    EXPECT_EQ(points.at(0, 3 * kSecond).position, 4.0);
    EXPECT_EQ(points.last(1).position, -4.0);
    EXPECT_EQ(points.begin(), 0);
    EXPECT_EQ(points.end(), 3 * kSecond);
}

TEST(TrajectoryPoints, KeepsItsMotionWhenPointsOfThePastAreForgotten) {
    TrajectoryPoints points(2);
    for (int i = 0; i < 10; ++i) append(points, i * kSecond, i % 3);
    const Motion before = points.at(0, 7 * kSecond / 2);
    points.forgetBefore(7 * kSecond / 2);
    EXPECT_EQ(points.size(), 7U);
    EXPECT_EQ(points.begin(), 3 * kSecond);
    EXPECT_EQ(points.at(0, 7 * kSecond / 2).position, before.position);
    points.forgetBefore(100 * kSecond);
    EXPECT_EQ(points.size(), 2U);
}

TEST(TrajectoryPoints, ReplacesTheTail) {
    TrajectoryPoints points(2);
    for (int i = 0; i < 10; ++i) append(points, i * kSecond, i);
    EXPECT_EQ(points.countBefore(4 * kSecond), 4U);
    EXPECT_EQ(points.countBefore(4 * kSecond + 1), 5U);
    points.truncate(4 * kSecond);
    EXPECT_EQ(points.end(), 3 * kSecond);
    points.append(4 * kSecond, PointKind::Position)[0] = {7.0, 0.0, 0.0};
    EXPECT_EQ(points.kindAt(7 * kSecond / 2), PointKind::Position);
    EXPECT_EQ(points.kindAt(3 * kSecond), PointKind::PositionVelocity);
    EXPECT_DOUBLE_EQ(points.at(0, 7 * kSecond / 2).position, 5.0);
}

TEST(TrajectoryPoints, GoesOnWithoutEndWithinItsCapacity) {
    TrajectoryPoints points(1);
    for (std::size_t i = 0; i < 5 * TrajectoryPoints::kCapacity; ++i) {
        const auto time = static_cast<std::int64_t>(i) * kSecond;
        points.append(time, PointKind::Position)[0] = {static_cast<double>(i), 0.0, 0.0};
        points.forgetBefore(time - 10 * kSecond);
        ASSERT_DOUBLE_EQ(points.at(0, time - kSecond / 2).position,
                         i == 0 ? 0.0 : static_cast<double>(i) - 0.5);
    }
    EXPECT_LE(points.size(), 12U);
}

}  // namespace
}  // namespace rtcf::test
