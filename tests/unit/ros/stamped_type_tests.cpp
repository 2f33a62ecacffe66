#include "ros/topics/stamped_type.hpp"

#include <gtest/gtest.h>
#include <ros/serialization.h>
#include <rtcf_msgs/BoolStamped.h>
#include <rtcf_msgs/Float32Stamped.h>
#include <rtcf_msgs/Float64Stamped.h>
#include <rtcf_msgs/Int16Stamped.h>
#include <rtcf_msgs/Int32Stamped.h>
#include <rtcf_msgs/Int64Stamped.h>
#include <rtcf_msgs/Int8Stamped.h>
#include <rtcf_msgs/UInt16Stamped.h>
#include <rtcf_msgs/UInt32Stamped.h>
#include <rtcf_msgs/UInt64Stamped.h>
#include <rtcf_msgs/UInt8Stamped.h>

#include <cstdint>
#include <limits>
#include <vector>

#include "ros/transport/raw_message.hpp"
#include "rtcf/component.hpp"

namespace rtcf::ros1 {
namespace {

// A port type, and its stamped message.
template <typename Port, typename Stamped>
struct Pair {
    using Value = Port;
    using Message = Stamped;
};

template <typename Types>
class StampedTypeTest : public ::testing::Test {};

using Pairs = ::testing::Types<
    Pair<bool, rtcf_msgs::BoolStamped>, Pair<float, rtcf_msgs::Float32Stamped>,
    Pair<double, rtcf_msgs::Float64Stamped>, Pair<std::int8_t, rtcf_msgs::Int8Stamped>,
    Pair<std::int16_t, rtcf_msgs::Int16Stamped>, Pair<std::int32_t, rtcf_msgs::Int32Stamped>,
    Pair<std::int64_t, rtcf_msgs::Int64Stamped>, Pair<std::uint8_t, rtcf_msgs::UInt8Stamped>,
    Pair<std::uint16_t, rtcf_msgs::UInt16Stamped>, Pair<std::uint32_t, rtcf_msgs::UInt32Stamped>,
    Pair<std::uint64_t, rtcf_msgs::UInt64Stamped>>;
TYPED_TEST_SUITE(StampedTypeTest, Pairs);

TYPED_TEST(StampedTypeTest, CarriesTheValueAndTheStamp) {
    using Value = typename TypeParam::Value;
    using Message = typename TypeParam::Message;
    const TypeInfo& port = typeInfo<Value>();
    const MessageType* type = stampedType(port.ros_type);
    ASSERT_NE(type, nullptr);
    EXPECT_EQ(type->name, ros::message_traits::datatype<Message>());
    EXPECT_EQ(type->md5, ros::message_traits::md5sum<Message>());
    EXPECT_TRUE(startsWithHeader(type->definition)) << "roscpp numbers messages with a header";

    Slot<Value> slot;
    slot.value = std::numeric_limits<Value>::max();
    std::vector<std::uint8_t> bytes(port.length(slot));
    port.serialize(slot, bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    std::vector<std::uint8_t> stamped{1, 2, 3};  // of the previous message
    stampBytes(bytes.data(), static_cast<std::uint32_t>(bytes.size()), 4'000'000'123, stamped);
    Message message;
    ros::serialization::IStream stream(stamped.data(), static_cast<std::uint32_t>(stamped.size()));
    ros::serialization::deserialize(stream, message);
    EXPECT_EQ(stream.getLength(), 0U) << "no bytes may be left";
    EXPECT_EQ(static_cast<Value>(message.data), slot.value);
    EXPECT_EQ(message.header.stamp, ros::Time(4, 123));
    EXPECT_EQ(message.header.frame_id, "");
}

TEST(StampedType, OthersHaveNone) {
    EXPECT_EQ(stampedType("std_msgs/String"), nullptr);
    EXPECT_EQ(stampedType("std_msgs/Float64MultiArray"), nullptr);
    EXPECT_EQ(stampedType("geometry_msgs/PoseStamped"), nullptr);
    EXPECT_EQ(stampedType(""), nullptr);
}

// A stepped loop's first cycles are at time 0; an earlier cycle is before ROS's first time.
TEST(StampedType, ATimeBeforeRossFirstIsZero) {
    const std::uint8_t byte = 1;
    std::vector<std::uint8_t> stamped;
    stampBytes(&byte, 1, -5, stamped);
    EXPECT_EQ(stamped,
              (std::vector<std::uint8_t>{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1}));
}

}  // namespace
}  // namespace rtcf::ros1
