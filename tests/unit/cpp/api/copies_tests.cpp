// The bytes of a value that its message contains. They turn frames into messages without the type.
#include <geometry_msgs/Twist.h>
#include <geometry_msgs/Vector3.h>
#include <gtest/gtest.h>
#include <rosgraph_msgs/Clock.h>
#include <std_msgs/ColorRGBA.h>
#include <std_msgs/String.h>
#include <std_msgs/UInt8.h>

#include <array>
#include <cstring>
#include <string>

#include "rtcf/component.hpp"
#include "rtcf/eigen_type.hpp"

namespace rtcf::test {

// A byte before a number: memory has padding between them, a message does not.
struct Padded {
    std::uint8_t joint = 0;
    double angle = 0.0;
};
struct Point {
    double y, x;
};
struct PointOnRos {
    static const char* name() { return "Point"; }
    static void toMessage(const Point& value, geometry_msgs::Vector3& message) {
        message.x = value.x;
        message.y = value.y;
        message.z = 0.0;
    }
    static void fromMessage(const geometry_msgs::Vector3& message, Point& value) {
        value = {message.y, message.x};
    }
    static std::vector<ByteCopy> copies() { return {{0, 8, 8}, {8, 0, 8}}; }
};
struct Angle {
    double degrees;
};
struct AngleOnRos {
    static const char* name() { return "Angle"; }
    static void toMessage(const Angle& value, std_msgs::Float64& message) {
        message.data = value.degrees / 57.3;
    }
    static void fromMessage(const std_msgs::Float64& message, Angle& value) {
        value = {message.data * 57.3};
    }
};

}  // namespace rtcf::test

template <>
struct rtcf::PortType<rtcf::test::Point>
    : rtcf::MappedPortType<rtcf::test::Point, geometry_msgs::Vector3, rtcf::test::PointOnRos> {};
template <>
struct rtcf::PortType<rtcf::test::Angle>
    : rtcf::MappedPortType<rtcf::test::Angle, std_msgs::Float64, rtcf::test::AngleOnRos> {};

// A message adapted by hand: a field precedes one that is at a higher address.
namespace ros::message_traits {
template <>
struct IsMessage<rtcf::test::Padded> : TrueType {};
template <>
struct IsFixedSize<rtcf::test::Padded> : TrueType {};
template <>
struct MD5Sum<rtcf::test::Padded> {
    static const char* value() { return "0123456789abcdef0123456789abcdef"; }
    static const char* value(const rtcf::test::Padded&) { return value(); }
};
template <>
struct DataType<rtcf::test::Padded> {
    static const char* value() { return "rtcf_unit_test/Padded"; }
    static const char* value(const rtcf::test::Padded&) { return value(); }
};
template <>
struct Definition<rtcf::test::Padded> {
    static const char* value() { return "uint8 joint\nfloat64 angle\n"; }
    static const char* value(const rtcf::test::Padded&) { return value(); }
};
}  // namespace ros::message_traits
namespace ros::serialization {
template <>
struct Serializer<rtcf::test::Padded> {
    template <typename Stream, typename T>
    static void allInOne(Stream& stream, T message) {
        stream.next(message.joint);
        stream.next(message.angle);
    }
    ROS_DECLARE_ALLINONE_SERIALIZER
};
}  // namespace ros::serialization
namespace ros::message_operations {
template <>
struct Printer<rtcf::test::Padded> {
    template <typename Stream>
    static void stream(Stream& stream, const std::string&, const rtcf::test::Padded& value) {
        stream << value.angle;
    }
};
}  // namespace ros::message_operations

namespace rtcf::test {
namespace {

template <typename T>
std::string serialized(const T& value) {
    Slot<T> slot;
    slot.value = value;
    std::string bytes(typeInfo<T>().length(slot), '\0');
    typeInfo<T>().serialize(slot, reinterpret_cast<std::uint8_t*>(bytes.data()),
                            static_cast<std::uint32_t>(bytes.size()));
    return bytes;
}

template <typename T>
std::string copied(const T& value) {
    std::string bytes = typeInfo<T>().sample();
    const ByteCopies copies = typeInfo<T>().copies();
    if (!copies) return "not copied";
    for (const ByteCopy& copy : *copies)
        std::memcpy(bytes.data() + copy.to, reinterpret_cast<const char*>(&value) + copy.from,
                    copy.size);
    return bytes;
}

template <typename T>
void expectCopied(const T& value) {
    EXPECT_EQ(copied(value), serialized(value)) << typeInfo<T>().name;
}

TEST(Copies, OfNumbers) {
    expectCopied(true);
    expectCopied(std::int8_t{-7});
    expectCopied(std::uint16_t{0x0102});
    expectCopied(std::int64_t{-0x0102030405060708});
    expectCopied(1.5F);
    expectCopied(-2.25);
}

TEST(Copies, OfMatricesAreRowByRow) {
    Eigen::Matrix<double, 2, 3> by_columns;
    by_columns << 1, 2, 3, 4, 5, 6;
    expectCopied(by_columns);
    Eigen::Matrix<float, 2, 3, Eigen::RowMajor> by_rows;
    by_rows << 1, 2, 3, 4, 5, 6;
    expectCopied(by_rows);
    expectCopied(Eigen::Matrix<double, 4, 1>(1, 2, 3, 4));
    expectCopied(Eigen::Vector3d(1, 2, 3));
    expectCopied(Eigen::Quaterniond(4, 1, 2, 3));
}

TEST(Copies, OfMessagesAreTheirFields) {
    std_msgs::UInt8 byte;
    byte.data = 7;
    expectCopied(byte);
    geometry_msgs::Twist twist;
    twist.linear.x = 1.0;
    twist.angular.z = -2.0;
    expectCopied(twist);
    EXPECT_EQ(typeInfo<geometry_msgs::Twist>().copies(), std::vector<ByteCopy>({{0, 0, 48}}));
    rosgraph_msgs::Clock clock;
    clock.clock = ros::Time(12, 34);
    expectCopied(clock);
    std_msgs::ColorRGBA color;
    color.a = 0.5F;
    expectCopied(color);
}

TEST(Copies, OfMessagesSkipPadding) {
    const Padded value{7, 1.5};
    expectCopied(value);
    EXPECT_EQ(typeInfo<Padded>().copies(), std::vector<ByteCopy>({{0, 0, 1}, {8, 1, 8}}));
}

TEST(Copies, OfOwnTypesAreTheirBytes) { expectCopied(std::array<std::int32_t, 3>{1, 2, 3}); }

TEST(Copies, OfMappedTypesAreAsDeclared) { expectCopied(Point{1.0, 2.0}); }

TEST(Copies, AreUnknownWhereAMessageIsComputed) {
    EXPECT_FALSE(typeInfo<Angle>().copies());
    EXPECT_FALSE(typeInfo<Eigen::Isometry3d>().copies());
    EXPECT_FALSE(typeInfo<std_msgs::String>().copies()) << "of variable size";
}

TEST(Copies, SampleOfAMappedTypeNeedsNoConversion) {
    EXPECT_EQ(typeInfo<Angle>().sample(), std::string(8, '\0'));
    EXPECT_EQ(typeInfo<std_msgs::String>().sample(), std::string(4, '\0'));
}

}  // namespace
}  // namespace rtcf::test
