// Numbers of ROS messages, copied between a message and the record of a Python component.
#include "message_fields.hpp"

#include <geometry_msgs/TwistStamped.h>
#include <gtest/gtest.h>
#include <std_msgs/Bool.h>
#include <std_msgs/ColorRGBA.h>
#include <std_msgs/Duration.h>
#include <std_msgs/Float64MultiArray.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "message_adapter.hpp"

namespace rtcf::test {

namespace {

using python::LeafTable;
using python::MessageField;
using python::MessageFields;
using python::MessageTable;

template <typename T>
T at(const std::vector<std::byte>& record, std::size_t offset) {
    T value{};
    std::memcpy(&value, &record.at(offset), sizeof value);
    return value;
}

template <typename T>
void put(std::vector<std::byte>& record, std::size_t offset, T value) {
    std::memcpy(&record.at(offset), &value, sizeof value);
}

}  // namespace

class Stamped : public testing::Test {
   protected:
    using Message = geometry_msgs::TwistStamped;
    const std::array<MessageField, 8> adapted_{
        RTCF_PYTHON_FIELD(header.seq, UInt32),     RTCF_PYTHON_FIELD(header.stamp, Int64),
        RTCF_PYTHON_FIELD(twist.linear.x, Double), RTCF_PYTHON_FIELD(twist.linear.y, Double),
        RTCF_PYTHON_FIELD(twist.linear.z, Double), RTCF_PYTHON_FIELD(twist.angular.x, Double),
        RTCF_PYTHON_FIELD(header.frame_id, UInt8), {}};
    const MessageTable table_{&typeInfo<Message>, adapted_.data()};
    const std::array<LeafTable, 6> leaves_{{{0, 0, -1, 1},
                                            {1, 8, -1, 1},
                                            {2, 16, -1, 1},
                                            {3, 24, -1, 1},
                                            {4, 32, -1, 1},
                                            {5, 40, -1, 1}}};
    const MessageFields fields_{table_, leaves_.data(), static_cast<std::int64_t>(leaves_.size())};
    std::vector<std::byte> record_ = std::vector<std::byte>(64);
    Message message_;
};

TEST_F(Stamped, NumbersAreCopiedBothWays) {
    message_.header.seq = 7;
    message_.header.stamp = ros::Time(3, 5);
    message_.twist.linear.x = 1.0;
    message_.twist.linear.z = -2.5;
    message_.twist.angular.x = 4.0;
    ASSERT_TRUE(fields_.fit(&message_));
    fields_.toRecord(record_.data(), &message_);
    EXPECT_EQ(at<std::uint32_t>(record_, 0), 7U);
    EXPECT_EQ(at<std::int64_t>(record_, 8), 3'000'000'005);
    EXPECT_EQ(at<double>(record_, 16), 1.0);
    EXPECT_EQ(at<double>(record_, 32), -2.5);
    EXPECT_EQ(at<double>(record_, 40), 4.0);
    EXPECT_EQ(at<double>(record_, 48), 0.0);
    Message back;
    fields_.toMessage(&back, record_.data());
    EXPECT_EQ(typeInfo<Message>().print(Slot<Message>{{}, back}),
              typeInfo<Message>().print(Slot<Message>{{}, message_}));
}

TEST_F(Stamped, ATimeOutOfRangeIsClamped) {
    put(record_, 8, std::int64_t{-1});
    fields_.toMessage(&message_, record_.data());
    EXPECT_EQ(message_.header.stamp, ros::Time(0, 999'999'999));
    put(record_, 8, std::numeric_limits<std::int64_t>::max());
    fields_.toMessage(&message_, record_.data());
    EXPECT_EQ(message_.header.stamp.sec, std::numeric_limits<std::uint32_t>::max());
}

TEST_F(Stamped, TextsAreSetOnce) {
    const char* const text = "tip";
    python::setText(&message_, table_, {6, &text, 1});
    EXPECT_EQ(message_.header.frame_id, "tip");
}

TEST(MessageFields, ADurationMayBeNegative) {
    using Message = std_msgs::Duration;
    const std::array<MessageField, 1> adapted{RTCF_PYTHON_FIELD(data, Int64)};
    const MessageTable table{&typeInfo<Message>, adapted.data()};
    const LeafTable leaf{0, 0, -1, 1};
    const MessageFields fields(table, &leaf, 1);
    Message message;
    message.data = ros::Duration(-3, 250'000'000);
    std::vector<std::byte> record(8);
    fields.toRecord(record.data(), &message);
    EXPECT_EQ(at<std::int64_t>(record, 0), -2'750'000'000);
    Message back;
    fields.toMessage(&back, record.data());
    EXPECT_EQ(back.data, message.data);
}

TEST(MessageFields, AnyByteButZeroIsTrue) {
    using Message = std_msgs::Bool;
    const std::array<MessageField, 1> adapted{RTCF_PYTHON_FIELD(data, Bool)};
    const MessageTable table{&typeInfo<Message>, adapted.data()};
    const LeafTable leaf{0, 0, -1, 1};
    const MessageFields fields(table, &leaf, 1);
    std::vector<std::byte> record(1);
    for (const int byte : {0, 1, 2, 128, 255}) {
        Message message;
        message.data = static_cast<std::uint8_t>(byte);
        fields.toRecord(record.data(), &message);
        EXPECT_EQ(at<std::uint8_t>(record, 0), byte == 0 ? 0 : 1);
    }
}

TEST(MessageFields, ASequenceHasAsManyElementsAsTheMessage) {
    using Message = std_msgs::Float64MultiArray;
    const std::array<MessageField, 2> adapted{RTCF_PYTHON_FIELD(layout.data_offset, UInt32),
                                              RTCF_PYTHON_FIELD(data, Double)};
    const MessageTable table{&typeInfo<Message>, adapted.data()};
    const LeafTable leaf{1, 0, 24, 3};
    const MessageFields fields(table, &leaf, 1);
    std::vector<std::byte> record(32);
    Message message;
    for (const std::vector<double>& data :
         {std::vector<double>{1.0, 2.0, 3.0}, std::vector<double>{4.0}, std::vector<double>{}}) {
        message.data = data;
        ASSERT_TRUE(fields.fit(&message));
        fields.toRecord(record.data(), &message);
        EXPECT_EQ(at<std::int64_t>(record, 24), static_cast<std::int64_t>(data.size()));
        for (std::size_t i = 0; i < data.size(); ++i) EXPECT_EQ(at<double>(record, 8 * i), data[i]);
    }
    message.data.resize(4);
    EXPECT_FALSE(fields.fit(&message));
    Message sent;
    fields.resize(&sent);
    EXPECT_EQ(sent.data.size(), 3U);
    fields.toMessage(&sent, record.data());
    EXPECT_EQ(sent.data, (std::vector<double>{4.0, 2.0, 3.0}));
}

TEST(MessageFields, NeighboursOfTheSameSizeStayApart) {
    using Message = std_msgs::ColorRGBA;
    const std::array<MessageField, 4> adapted{
        RTCF_PYTHON_FIELD(r, Float), RTCF_PYTHON_FIELD(g, Float), RTCF_PYTHON_FIELD(b, Float),
        RTCF_PYTHON_FIELD(a, Float)};
    const MessageTable table{&typeInfo<Message>, adapted.data()};
    // g is not used.
    const std::array<LeafTable, 3> leaves{{{0, 0, -1, 1}, {2, 4, -1, 1}, {3, 8, -1, 1}}};
    const MessageFields fields(table, leaves.data(), std::int64_t{3});
    Message message;
    message.r = 1.0F;
    message.g = 2.0F;
    message.b = 3.0F;
    message.a = 4.0F;
    std::vector<std::byte> record(12);
    fields.toRecord(record.data(), &message);
    EXPECT_EQ(at<float>(record, 0), 1.0F);
    EXPECT_EQ(at<float>(record, 4), 3.0F);
    EXPECT_EQ(at<float>(record, 8), 4.0F);
}

}  // namespace rtcf::test
