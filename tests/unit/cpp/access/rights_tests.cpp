// Rights at an executor: the same answers as rtcfd's [access].
#include "access/rights.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

namespace rtcf {
namespace {

using executor::Access;
using executor::AccessRules;
using executor::Right;

constexpr uid_t kAlice = 4001;
constexpr uid_t kBob = 4002;
constexpr gid_t kDoor = 5000;
constexpr gid_t kStudents = 5001;
constexpr gid_t kStaff = 5002;

AccessRules rules() {
    AccessRules rules;
    rules.others = Right::Observe;
    rules.users[kAlice] = Right::None;
    rules.groups[kStudents] = Right::Tune;
    rules.groups[kStaff] = Right::Operate;
    rules.door_group = kDoor;
    return rules;
}

TEST(Rights, AreGrantedToRootAndTheOwnUserWithoutRules) {
    const Access access;
    EXPECT_EQ(access.of(0, {0}), Right::Admin);
    EXPECT_EQ(access.of(::geteuid(), {kDoor}), Right::Admin);
    EXPECT_EQ(access.of(kBob, {kDoor, kStaff}), Right::None);
}

TEST(Rights, OfAUserPrecedeThoseOfItsGroups) {
    Access access;
    access.set(rules());
    EXPECT_EQ(access.of(kAlice, {kDoor, kStaff}), Right::None);
    EXPECT_EQ(access.of(kBob, {kDoor, kStudents}), Right::Tune);
    EXPECT_EQ(access.of(kBob, {kStaff, kDoor, kStudents}), Right::Operate);
    EXPECT_EQ(access.of(kBob, {kDoor}), Right::Observe);
}

TEST(Rights, RequireAccessToTheDaemon) {
    Access access;
    AccessRules closed = rules();
    access.set(closed);
    EXPECT_EQ(access.of(kBob, {kStaff}), Right::None);
    closed.door_open = true;
    access.set(closed);
    EXPECT_EQ(access.of(kBob, {kStaff}), Right::Operate);
    closed.door_open = false;
    closed.door_group.reset();
    access.set(closed);
    EXPECT_EQ(access.of(kBob, {kDoor, kStaff}), Right::None);
}

}  // namespace
}  // namespace rtcf
