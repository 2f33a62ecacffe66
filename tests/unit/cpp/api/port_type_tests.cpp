// Each port type against roscpp's serialisation of its message.
#include <geometry_msgs/Pose.h>
#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/Quaternion.h>
#include <geometry_msgs/Vector3.h>
#include <gtest/gtest.h>
#include <ros/serialization.h>
#include <std_msgs/Float32MultiArray.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_msgs/String.h>

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "rtcf/component.hpp"
#include "rtcf/eigen_type.hpp"

namespace rtcf::test {

struct Gains {
    std::int32_t joint;
    double gain;
};
enum class Grip : std::uint8_t { Idle = 0, Force = 7 };
struct Target {
    double x, y, z;
};
struct TargetOnRos {
    static const char* name() { return "Target"; }
    static void toMessage(const Target& value, geometry_msgs::Vector3& message) {
        message.x = value.x;
        message.y = value.y;
        message.z = value.z;
    }
    static void fromMessage(const geometry_msgs::Vector3& message, Target& value) {
        value = {message.x, message.y, message.z};
    }
};

}  // namespace rtcf::test

template <>
struct rtcf::PortType<rtcf::test::Target>
    : rtcf::MappedPortType<rtcf::test::Target, geometry_msgs::Vector3, rtcf::test::TargetOnRos> {};

namespace rtcf::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <typename Message>
Bytes roscppBytes(const Message& message) {
    Bytes bytes(ros::serialization::serializationLength(message));
    ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    ros::serialization::serialize(stream, message);
    return bytes;
}

// Through the type-erased functions, as the executor does.
template <typename T>
Bytes rtcfBytes(const T& value) {
    Slot<T> slot;
    slot.value = value;
    const TypeInfo& type = typeInfo<T>();
    Bytes bytes(type.length(slot));
    type.serialize(slot, bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    return bytes;
}

template <typename T>
bool deserialize(const Bytes& bytes, T& value) {
    Slot<T> slot;
    const bool done =
        typeInfo<T>().deserialize(slot, bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    value = slot.value;
    return done;
}

template <typename T>
T roundTrip(const T& value) {
    T result{};
    EXPECT_TRUE(deserialize(rtcfBytes(value), result));
    return result;
}

// Every proper prefix of the bytes, and the bytes plus one, are invalid messages.
template <typename T>
void expectOtherLengthsRefused(const T& value) {
    const Bytes bytes = rtcfBytes(value);
    T ignored{};
    for (std::size_t size = 0; size < bytes.size(); ++size) {
        ASSERT_FALSE(deserialize(
            Bytes(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)), ignored))
            << size;
    }
    Bytes longer = bytes;
    longer.push_back(0);
    ASSERT_FALSE(deserialize(longer, ignored));
}

template <typename Message, typename T>
void expectArithmetic(const char* name) {
    for (const T value :
         {std::numeric_limits<T>::lowest(), T{0}, T{1}, std::numeric_limits<T>::max()}) {
        Message message;
        message.data = value;
        EXPECT_EQ(rtcfBytes(value), roscppBytes(message)) << name;
        EXPECT_EQ(roundTrip(value), value) << name;
    }
    const TypeInfo& type = typeInfo<T>();
    EXPECT_STREQ(type.name, name);
    EXPECT_STREQ(type.ros_type, ros::message_traits::datatype<Message>());
    EXPECT_STREQ(type.ros_md5, ros::message_traits::md5sum<Message>());
    EXPECT_TRUE(type.fixed_size);
    expectOtherLengthsRefused(T{1});
}

TEST(ArithmeticType, IsSentAsTheMessageOfItsWidth) {
    expectArithmetic<std_msgs::Bool, bool>("bool");
    expectArithmetic<std_msgs::Int8, std::int8_t>("int8");
    expectArithmetic<std_msgs::Int16, std::int16_t>("int16");
    expectArithmetic<std_msgs::Int32, std::int32_t>("int32");
    expectArithmetic<std_msgs::Int64, std::int64_t>("int64");
    expectArithmetic<std_msgs::UInt8, std::uint8_t>("uint8");
    expectArithmetic<std_msgs::UInt16, std::uint16_t>("uint16");
    expectArithmetic<std_msgs::UInt32, std::uint32_t>("uint32");
    expectArithmetic<std_msgs::UInt64, std::uint64_t>("uint64");
    expectArithmetic<std_msgs::Float32, float>("float");
    expectArithmetic<std_msgs::Float64, double>("double");
}

TEST(EigenType, Vector3dIsAVector3) {
    geometry_msgs::Vector3 message;
    message.x = 1.0;
    message.y = -2.0;
    message.z = 3.5;
    const Eigen::Vector3d value(1.0, -2.0, 3.5);
    EXPECT_EQ(rtcfBytes(value), roscppBytes(message));
    EXPECT_EQ(roundTrip(value), value);
    expectOtherLengthsRefused(value);
}

TEST(EigenType, QuaterniondIsAQuaternion) {
    geometry_msgs::Quaternion message;
    message.x = 0.1;
    message.y = 0.2;
    message.z = 0.3;
    message.w = 0.9;
    const Eigen::Quaterniond value(0.9, 0.1, 0.2, 0.3);
    EXPECT_EQ(rtcfBytes(value), roscppBytes(message));
    EXPECT_EQ(roundTrip(value).coeffs(), value.coeffs());
    expectOtherLengthsRefused(value);
}

TEST(EigenType, Isometry3dIsAPose) {
    Eigen::Isometry3d value = Eigen::Isometry3d::Identity();
    value.linear() =
        Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, 3.0).normalized()).toRotationMatrix();
    value.translation() = Eigen::Vector3d(4.0, 5.0, 6.0);
    const Eigen::Quaterniond rotation(value.linear());
    geometry_msgs::Pose message;
    message.position.x = 4.0;
    message.position.y = 5.0;
    message.position.z = 6.0;
    message.orientation.x = rotation.x();
    message.orientation.y = rotation.y();
    message.orientation.z = rotation.z();
    message.orientation.w = rotation.w();
    EXPECT_EQ(rtcfBytes(value), roscppBytes(message));
    EXPECT_TRUE(roundTrip(value).isApprox(value, 1e-12));
    expectOtherLengthsRefused(value);
}

template <typename Message, typename Matrix>
Message multiArrayOf(const Matrix& value) {
    Message message;
    message.layout.dim.resize(2);
    message.layout.dim[0].label = "rows";
    message.layout.dim[0].size = static_cast<std::uint32_t>(value.rows());
    message.layout.dim[0].stride = static_cast<std::uint32_t>(value.size());
    message.layout.dim[1].label = "cols";
    message.layout.dim[1].size = static_cast<std::uint32_t>(value.cols());
    message.layout.dim[1].stride = static_cast<std::uint32_t>(value.cols());
    for (Eigen::Index row = 0; row < value.rows(); ++row) {
        for (Eigen::Index col = 0; col < value.cols(); ++col)
            message.data.push_back(value(row, col));
    }
    return message;
}

template <typename Message, typename Matrix>
void expectMatrix() {
    const Matrix value = Matrix::Random();
    EXPECT_EQ(rtcfBytes(value), roscppBytes(multiArrayOf<Message>(value)));
    EXPECT_EQ(roundTrip(value), value);
    EXPECT_TRUE(typeInfo<Matrix>().fixed_size);
    expectOtherLengthsRefused(value);
}

TEST(EigenType, MatrixIsAMultiArrayRowByRow) {
    expectMatrix<std_msgs::Float64MultiArray, Eigen::Matrix<double, 7, 1>>();
    expectMatrix<std_msgs::Float64MultiArray, Eigen::Matrix<double, 1, 4>>();
    expectMatrix<std_msgs::Float64MultiArray, Eigen::Matrix4d>();
    expectMatrix<std_msgs::Float64MultiArray, Eigen::Matrix<double, 2, 3>>();
    expectMatrix<std_msgs::Float64MultiArray, Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>();
    expectMatrix<std_msgs::Float32MultiArray, Eigen::Vector3f>();
    expectMatrix<std_msgs::Float32MultiArray, Eigen::Matrix<float, 3, 2>>();
}

TEST(EigenType, MatrixOfAnotherSizeIsRejected) {
    Eigen::Matrix2d ignored;
    EXPECT_FALSE(deserialize(rtcfBytes(Eigen::Matrix<double, 2, 3>::Zero().eval()), ignored));
    EXPECT_FALSE(deserialize(rtcfBytes(Eigen::Matrix<double, 1, 3>::Zero().eval()), ignored));
}

TEST(EigenType, MatrixWithoutLayoutIsAcceptedByItsSize) {
    std_msgs::Float64MultiArray message;
    message.data = {1.0, 2.0, 3.0, 4.0};
    Eigen::Matrix2d value;
    ASSERT_TRUE(deserialize(roscppBytes(message), value));
    EXPECT_EQ(value(0, 1), 2.0);
    EXPECT_EQ(value(1, 0), 3.0);
}

struct Point {
    double x = 0.0;
    double y = 0.0;
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("x", x);
        visit("y", y);
    }
};

// Structs that differ from each other in one thing.
template <int Variant>
struct Shape {
    std::conditional_t<Variant == 1, float, double> width = 0;
    Point corner;
    std::array<std::int32_t, Variant == 2 ? 3 : 2> sides{};
    float edges[2] = {0.0F, 0.0F};  // NOLINT(modernize-avoid-c-arrays): a type that users have
    template <typename Visit>
    void fields(Visit&& visit) {
        visit(Variant == 3 ? "breadth" : "width", width);
        if (Variant != 4) visit("corner", corner);
        visit("sides", sides);
        visit("edges", edges);
    }
};

TEST(AnyType, IsKnownByTheFieldsThatItNames) {
    const std::string layout = typeInfo<Shape<0>>().md5;
    EXPECT_EQ(layout.size(), 16U);
    EXPECT_EQ(layout, typeInfo<Shape<5>>().md5) << "the definitions are the same";
    EXPECT_NE(layout, typeInfo<Shape<1>>().md5);
    EXPECT_NE(layout, typeInfo<Shape<2>>().md5);
    EXPECT_NE(layout, typeInfo<Shape<3>>().md5);
    EXPECT_NE(layout, typeInfo<Shape<4>>().md5);
    using Shapes = std::array<Shape<0>, 2>;
    EXPECT_EQ(layout, typeInfo<Shapes>().md5);
    EXPECT_EQ(layout, typeInfo<std::vector<Shapes>>().md5);
    EXPECT_STREQ(typeInfo<std::string>().md5, "");
}

TEST(AnyType, IsCopiedByteByByte) {
    Gains gains{};
    EXPECT_TRUE(deserialize(rtcfBytes(Gains{3, 0.5}), gains));
    EXPECT_EQ(gains.joint, 3);
    EXPECT_EQ(gains.gain, 0.5);
    EXPECT_FALSE(deserialize(Bytes(3), gains));
    Grip mode{};
    EXPECT_TRUE(deserialize(rtcfBytes(Grip::Force), mode));
    EXPECT_EQ(mode, Grip::Force);
    std::vector<double> numbers;
    EXPECT_TRUE(deserialize(rtcfBytes(std::vector<double>{1.0, 2.0}), numbers));
    EXPECT_EQ(numbers, (std::vector<double>{1.0, 2.0}));
    EXPECT_FALSE(deserialize(Bytes(9), numbers));
    std::string text;
    EXPECT_TRUE(deserialize(rtcfBytes(std::string("two words")), text));
    EXPECT_EQ(text, "two words");
}

TEST(AnyType, IsNotOnRosAndHasItsCppName) {
    EXPECT_STREQ(typeInfo<Gains>().name, "rtcf::test::Gains");
    EXPECT_STREQ(typeInfo<std::string>().name, "std::string");
    EXPECT_STREQ(typeInfo<Gains>().ros_type, "");
    EXPECT_TRUE(typeInfo<Gains>().fixed_size);
    EXPECT_FALSE(typeInfo<std::vector<Gains>>().fixed_size);
}

TEST(AnyType, IsPrintedAsFarAsItsTypeIsKnown) {
    EXPECT_EQ(PortType<Grip>::print(Grip::Force), "7");
    EXPECT_EQ((PortType<std::array<float, 2>>::print({0.5F, -1.0F})), "[0.5, -1]");
    EXPECT_EQ(PortType<std::string>::print("a b"), "\"a b\"");
    EXPECT_EQ((PortType<std::array<Grip, 2>>::print({Grip::Idle, Grip::Force})), "[0, 7]");
    struct Pair {
        std::uint8_t one, two;
    };
    EXPECT_EQ(PortType<Pair>::print({1, 255}), "0x01ff");
}

TEST(AnyType, IsOnRosIfItHasAMessage) {
    EXPECT_STREQ(typeInfo<Target>().ros_type, "geometry_msgs/Vector3");
    geometry_msgs::Vector3 message;
    message.y = 2.0;
    EXPECT_EQ(rtcfBytes(Target{0.0, 2.0, 0.0}), roscppBytes(message));
}

TEST(MessageType, MatchesRoscpp) {
    geometry_msgs::PoseArray message;
    message.header.frame_id = "base";
    message.poses.resize(2);
    message.poses[1].position.y = 0.5;
    EXPECT_EQ(rtcfBytes(message), roscppBytes(message));
    EXPECT_EQ(roundTrip(message), message);
    EXPECT_FALSE(typeInfo<geometry_msgs::PoseArray>().fixed_size);
    expectOtherLengthsRefused(message);
}

TEST(MessageType, IsPrintedOnOneLine) {
    Slot<geometry_msgs::Pose> slot;
    const std::string text = typeInfo<geometry_msgs::Pose>().print(slot);
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    EXPECT_NE(text.find("orientation"), std::string::npos) << text;
}

TEST(PortType, SlotIsCreatedWithTheSamplesValue) {
    Slot<std_msgs::String> sample;
    sample.value.data = "long enough not to fit into the string itself";
    sample.stamp = 5;
    const auto made = typeInfo<std_msgs::String>().make_slot(&sample);
    EXPECT_EQ(static_cast<Slot<std_msgs::String>&>(*made).value.data, sample.value.data);
    EXPECT_EQ(made->stamp, 0) << "a new slot was never written";
}

TEST(PortType, CopyIncludesValueAndHeader) {
    Slot<double> from;
    from.value = 2.5;
    from.stamp = 5;
    Slot<double> to;
    typeInfo<double>().copy(to, from);
    EXPECT_EQ(to.value, 2.5);
    EXPECT_EQ(to.stamp, 5);
}

TEST(SameType, IsDecidedByNameMd5SizeAndAlignment) {
    const TypeInfo& original = typeInfo<std_msgs::Float64>();
    TypeInfo other = original;  // as in another library
    const std::string name = original.name;
    other.name = name.c_str();
    EXPECT_TRUE(sameType(original, other));
    other.md5 = "00000000000000000000000000000000";
    EXPECT_FALSE(sameType(original, other));
    other = original;
    other.size *= 2;
    EXPECT_FALSE(sameType(original, other));
    other = original;
    other.alignment *= 2;
    EXPECT_FALSE(sameType(original, other));
}

TEST(SameType, IncludesAMessageOfOneFieldWithTheSameLayout) {
    EXPECT_TRUE(sameType(typeInfo<double>(), typeInfo<std_msgs::Float64>()));
    EXPECT_FALSE(sameType(typeInfo<float>(), typeInfo<std_msgs::Float64>()));
}

TEST(SameType, DistinguishesTypesOfTheSameMessage) {
    EXPECT_FALSE(sameType(typeInfo<Eigen::Matrix2d>(), typeInfo<Eigen::Matrix<double, 4, 1>>()));
    EXPECT_FALSE(sameType(typeInfo<Eigen::Matrix<double, 2, 3>>(),
                          typeInfo<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>()))
        << "their memory layouts differ";
}

}  // namespace
}  // namespace rtcf::test
