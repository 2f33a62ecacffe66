// Minima and maxima of values without their types, and the offsets of their numbers.
#include "watch/extremes.hpp"

#include <geometry_msgs/TwistStamped.h>
#include <gtest/gtest.h>
#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64MultiArray.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "watch/number_fields.hpp"

namespace rtcf::test {
namespace {

using executor::Extremes;
using executor::NumberField;
using executor::NumberKind;
using executor::numbersOfMessage;
using executor::numbersOfState;

template <typename Message>
std::string serialized(const Message& message) {
    std::string bytes(ros::serialization::serializationLength(message), '\0');
    ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                       static_cast<std::uint32_t>(bytes.size()));
    ros::serialization::serialize(stream, message);
    return bytes;
}

template <typename Message>
std::vector<NumberField> numbersOf(const Message& message) {
    return numbersOfMessage(ros::message_traits::Definition<Message>::value(), serialized(message));
}

std::size_t count(const std::vector<NumberField>& fields) {
    std::size_t result = 0;
    for (const NumberField& field : fields) result += field.count;
    return result;
}

template <typename T>
std::string bytesOf(const std::vector<T>& numbers) {
    return {reinterpret_cast<const char*>(numbers.data()), sizeof(T) * numbers.size()};
}

template <typename T>
std::vector<T> numbersIn(const std::string& bytes) {
    std::vector<T> result(bytes.size() / sizeof(T));
    std::memcpy(result.data(), bytes.data(), bytes.size());
    return result;
}

TEST(NumberFields, OfAMessageWithAHeader) {
    geometry_msgs::TwistStamped message;
    message.header.frame_id = "base";
    const auto fields = numbersOf(message);
    // The sequence number, a time, six numbers.
    EXPECT_EQ(count(fields), 9U);
    EXPECT_EQ(fields.front().kind, NumberKind::UInt32);
    EXPECT_EQ(fields.back().kind, NumberKind::Float64);
    EXPECT_EQ(fields.back().offset, serialized(message).size() - 8);
}

TEST(NumberFields, OfListsAsLongAsInTheSample) {
    sensor_msgs::JointState message;
    message.name = {"a", "elbow"};
    message.position = {1.0, 2.0};
    const auto fields = numbersOf(message);
    EXPECT_EQ(count(fields), 5U);
    EXPECT_EQ(fields.back().count, 2U);
    std_msgs::Float64MultiArray array;
    array.layout.dim.resize(2);
    array.data = {1.0, 2.0, 3.0};
    EXPECT_EQ(count(numbersOf(array)), 2U * 2U + 1U + 3U);
}

TEST(NumberFields, RejectAMessageThatContradictsItsDefinition) {
    EXPECT_THROW(numbersOfMessage("float64 data\n", std::string(7, '\0')), std::invalid_argument);
    EXPECT_THROW(numbersOfMessage("float64 data\n", std::string(9, '\0')), std::invalid_argument);
    EXPECT_THROW(numbersOfMessage("float64[] data\n", std::string(4, '\xff')),
                 std::invalid_argument);
}

TEST(NumberFields, OfStates) {
    EXPECT_EQ(count(numbersOfState("double[3x1]", 24)), 3U);
    EXPECT_EQ(count(numbersOfState("uint8[2x3,RowMajor]", 6)), 6U);
    EXPECT_EQ(count(numbersOfState("float[2x3x4]", 96)), 24U);
    EXPECT_EQ(numbersOfState("quaternion", 16).front().kind, NumberKind::Float32);
    EXPECT_EQ(count(numbersOfState("transform", 128)), 16U);
    EXPECT_TRUE(numbersOfState("{a: double}", 8).empty());
}

TEST(Extremes, HaveEachNumberAndItsFirstCycle) {
    Extremes extremes({{NumberKind::Float64, 0, 2}});
    extremes.add(bytesOf<double>({1.0, 5.0}), 3);
    extremes.add(bytesOf<double>({-2.0, 5.0}), 4);
    extremes.add(bytesOf<double>({-2.0, 9.0}), 7);
    std::string values;
    std::string places;
    extremes.take(values, places);
    EXPECT_EQ(numbersIn<double>(values), (std::vector<double>{-2.0, 5.0, 1.0, 9.0}));
    EXPECT_EQ(numbersIn<std::uint32_t>(places), (std::vector<std::uint32_t>{4, 3, 3, 7}));
    EXPECT_EQ(values.size() + places.size(), extremes.bytes(16));
    // The next window starts again.
    values.clear();
    places.clear();
    extremes.add(bytesOf<double>({0.0, 0.0}), 1);
    extremes.take(values, places);
    EXPECT_EQ(numbersIn<double>(values), std::vector<double>(4, 0.0));
}

TEST(Extremes, IncludeNan) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    for (const auto& order : {std::vector<double>{1.0, kNone}, {kNone, 1.0}}) {
        Extremes extremes({{NumberKind::Float64, 0, 1}});
        for (std::uint32_t i = 0; i < 2; ++i) extremes.add(bytesOf<double>({order[i]}), i);
        std::string values;
        std::string places;
        extremes.take(values, places);
        EXPECT_EQ(numbersIn<double>(values)[0], 1.0);
        EXPECT_TRUE(std::isnan(numbersIn<double>(values)[1]));
        EXPECT_EQ(numbersIn<std::uint32_t>(places)[1], std::isnan(order[1]) ? 1U : 0U);
    }
}

template <typename T>
void expectEnds(NumberKind kind) {
    Extremes extremes({{kind, 0, 1}});
    const T low = std::numeric_limits<T>::lowest();
    const T high = std::numeric_limits<T>::max();
    extremes.add(bytesOf<T>({T{1}}), 0);
    extremes.add(bytesOf<T>({high}), 1);
    extremes.add(bytesOf<T>({low}), 2);
    std::string values;
    std::string places;
    extremes.take(values, places);
    EXPECT_EQ(numbersIn<T>(values), (std::vector<T>{low, high}));
    EXPECT_EQ(numbersIn<std::uint32_t>(places), (std::vector<std::uint32_t>{2, 1}));
}

TEST(Extremes, SupportAllTypesOfNumbers) {
    expectEnds<std::int8_t>(NumberKind::Int8);
    expectEnds<std::uint8_t>(NumberKind::UInt8);
    expectEnds<std::int16_t>(NumberKind::Int16);
    expectEnds<std::uint16_t>(NumberKind::UInt16);
    expectEnds<std::int32_t>(NumberKind::Int32);
    expectEnds<std::uint32_t>(NumberKind::UInt32);
    expectEnds<std::int64_t>(NumberKind::Int64);
    expectEnds<std::uint64_t>(NumberKind::UInt64);
    expectEnds<float>(NumberKind::Float32);
    expectEnds<double>(NumberKind::Float64);
}

}  // namespace
}  // namespace rtcf::test
