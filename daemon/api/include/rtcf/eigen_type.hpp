/// @file
/// Fixed-size Eigen types as port types. Include this header beside component.hpp in components
/// with such ports.
///
/// | C++ | on ROS |
/// | --- | --- |
/// | `Eigen::Vector3d` | geometry_msgs/Vector3 |
/// | `Eigen::Quaterniond` | geometry_msgs/Quaternion |
/// | `Eigen::Isometry3d` | geometry_msgs/Pose |
/// | other fixed-size matrices of double | std_msgs/Float64MultiArray, row by row |
/// | other fixed-size matrices of float | std_msgs/Float32MultiArray, row by row |
#pragma once

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/Quaternion.h>
#include <geometry_msgs/Vector3.h>
#include <std_msgs/Float32MultiArray.h>
#include <std_msgs/Float64MultiArray.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstring>
#include <stdexcept>

#include "rtcf/message_type.hpp"

namespace rtcf {

namespace detail {

struct Vector3Conversion {
    static const char* name() { return "Eigen::Vector3d"; }
    static void toMessage(const Eigen::Vector3d& value, geometry_msgs::Vector3& message) {
        message.x = value.x();
        message.y = value.y();
        message.z = value.z();
    }
    static void fromMessage(const geometry_msgs::Vector3& message, Eigen::Vector3d& value) {
        value = {message.x, message.y, message.z};
    }
    static std::vector<ByteCopy> copies() { return {{0, 0, sizeof(Eigen::Vector3d)}}; }
};

struct QuaternionConversion {
    static const char* name() { return "Eigen::Quaterniond"; }
    static void toMessage(const Eigen::Quaterniond& value, geometry_msgs::Quaternion& message) {
        message.x = value.x();
        message.y = value.y();
        message.z = value.z();
        message.w = value.w();
    }
    static void fromMessage(const geometry_msgs::Quaternion& message, Eigen::Quaterniond& value) {
        value = Eigen::Quaterniond(message.w, message.x, message.y, message.z);
    }
    // Both are x, y, z, w in memory.
    static std::vector<ByteCopy> copies() { return {{0, 0, sizeof(Eigen::Quaterniond)}}; }
};

struct IsometryConversion {
    static const char* name() { return "Eigen::Isometry3d"; }
    static void toMessage(const Eigen::Isometry3d& value, geometry_msgs::Pose& message) {
        message.position.x = value.translation().x();
        message.position.y = value.translation().y();
        message.position.z = value.translation().z();
        QuaternionConversion::toMessage(Eigen::Quaterniond(value.linear()), message.orientation);
    }
    static void fromMessage(const geometry_msgs::Pose& message, Eigen::Isometry3d& value) {
        Eigen::Quaterniond rotation;
        QuaternionConversion::fromMessage(message.orientation, rotation);
        value.setIdentity();
        value.linear() = rotation.normalized().toRotationMatrix();
        value.translation() =
            Eigen::Vector3d(message.position.x, message.position.y, message.position.z);
    }
};

template <typename Scalar>
struct MultiArray;
template <>
struct MultiArray<double> {
    using Message = std_msgs::Float64MultiArray;
    static constexpr const char* scalar = "double";
};
template <>
struct MultiArray<float> {
    using Message = std_msgs::Float32MultiArray;
    static constexpr const char* scalar = "float";
};

/// Header of a serialised matrix: two labelled dimensions, an offset of 0, and the number of
/// elements.
class MatrixHead {
   public:
    // dim count, two dims of (label length, label, size, stride), offset, data count
    static constexpr std::uint32_t kSize = 4 + 2 * (4 + 4 + 4 + 4) + 4 + 4;

    /// Real-time safe.
    static void write(ros::serialization::OStream& stream, std::uint32_t rows,
                      std::uint32_t columns) {
        stream.next(std::uint32_t{2});
        dimension(stream, "rows", rows, rows * columns);
        dimension(stream, "cols", columns, columns);
        stream.next(std::uint32_t{0});
        stream.next(rows * columns);
    }

   private:
    static constexpr std::uint32_t kLabelLength = 4;  // "rows", "cols"

    static void dimension(ros::serialization::OStream& stream, const char* label,
                          std::uint32_t size, std::uint32_t stride) {
        stream.next(kLabelLength);
        std::memcpy(stream.advance(kLabelLength), label, kLabelLength);
        stream.next(size);
        stream.next(stride);
    }
};

/// The elements of a message, row by row.
/// @throws std::length_error if the message has another number of elements
template <typename Message>
const auto* matrixElements(const Message& message, std::size_t count) {
    const std::size_t offset = message.layout.data_offset;
    if (message.data.size() < offset || message.data.size() - offset != count) {
        throw std::length_error("matrix of another size");
    }
    return message.data.data() + offset;
}

}  // namespace detail

template <>
struct PortType<Eigen::Vector3d>
    : MappedPortType<Eigen::Vector3d, geometry_msgs::Vector3, detail::Vector3Conversion> {};

template <>
struct PortType<Eigen::Quaterniond>
    : MappedPortType<Eigen::Quaterniond, geometry_msgs::Quaternion, detail::QuaternionConversion> {
};

template <>
struct PortType<Eigen::Isometry3d>
    : MappedPortType<Eigen::Isometry3d, geometry_msgs::Pose, detail::IsometryConversion> {};

/// Any other fixed-size matrix. It is serialised without a MultiArray message, which would
/// allocate.
template <typename Scalar, int Rows, int Cols, int Options, int MaxRows, int MaxCols>
struct PortType<Eigen::Matrix<Scalar, Rows, Cols, Options, MaxRows, MaxCols>,
                std::enable_if_t<(Rows > 0 && Cols > 0 &&
                                  !(std::is_same_v<Scalar, double> && Rows == 3 && Cols == 1))>> {
    using T = Eigen::Matrix<Scalar, Rows, Cols, Options, MaxRows, MaxCols>;
    using Message = typename detail::MultiArray<Scalar>::Message;
    static constexpr bool kFixedSize = true;

    static const char* name() {
        static const std::string text =
            std::string("Eigen::Matrix<") + detail::MultiArray<Scalar>::scalar + "," +
            std::to_string(Rows) + "," + std::to_string(Cols) + (kTransposed ? ",RowMajor>" : ">");
        return text.c_str();
    }
    static const char* md5() { return PortType<Message>::md5(); }
    static const char* rosType() { return PortType<Message>::name(); }
    static const char* rosMd5() { return PortType<Message>::md5(); }
    static const char* rosDefinition() { return PortType<Message>::rosDefinition(); }

    static std::uint32_t length(const T&) { return kHead + sizeof(Scalar) * Rows * Cols; }
    static void serialize(const T& value, std::uint8_t* to, std::uint32_t size) {
        ros::serialization::OStream stream(to, size);
        detail::MatrixHead::write(stream, Rows, Cols);
        for (int row = 0; row < Rows; ++row) {
            for (int col = 0; col < Cols; ++col) stream.next(value(row, col));
        }
    }
    static void deserialize(T& value, const std::uint8_t* from, std::uint32_t size) {
        Message message;
        PortType<Message>::deserialize(message, from, size);
        const Scalar* element = detail::matrixElements(message, std::size_t{Rows} * Cols);
        for (int row = 0; row < Rows; ++row) {
            for (int col = 0; col < Cols; ++col) value(row, col) = *element++;
        }
    }
    static std::string print(const T& value) {
        std::ostringstream text;
        detail::makeExact(text);
        text << value.format(Eigen::IOFormat(Eigen::StreamPrecision, Eigen::DontAlignCols, ", ",
                                             "; ", "", "", "[", "]"));
        return text.str();
    }
    static std::string sample() {
        std::string bytes(length(T()), '\0');
        serialize(T::Zero(), reinterpret_cast<std::uint8_t*>(bytes.data()),
                  static_cast<std::uint32_t>(bytes.size()));
        return bytes;
    }
    static ByteCopies copies() {
        constexpr std::uint32_t kScalar = sizeof(Scalar);
        std::vector<ByteCopy> copies;
        std::uint32_t to = kHead;
        for (int row = 0; row < Rows; ++row) {
            for (int col = 0; col < Cols; ++col, to += kScalar) {
                const int at = T::IsRowMajor ? row * Cols + col : col * Rows + row;
                const std::uint32_t from = static_cast<std::uint32_t>(at) * kScalar;
                if (!copies.empty() && copies.back().from + copies.back().size == from) {
                    copies.back().size += kScalar;
                } else {
                    copies.push_back({from, to, kScalar});
                }
            }
        }
        return copies;
    }

   private:
    // A row-major matrix is a port type of its own, because readers use the writer's memory. The
    // order does not matter for a vector.
    static constexpr bool kTransposed = (Options & Eigen::RowMajor) != 0 && Rows > 1 && Cols > 1;
    static constexpr std::uint32_t kHead = detail::MatrixHead::kSize;
};

}  // namespace rtcf
