/// @file
/// Whether a value holds no NaN and no infinity: numbers, Eigen matrices and
/// any ROS message, whose fields are visited by roscpp's own serializer.
#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <ros/time.h>

#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

namespace rtcf {

/// What happens to a value that is not finite, on an output that is declared so.
enum class OnNonFinite {
    Hold,  ///< the output keeps its last value, and its component is reported as faulted
    Stop,  ///< besides, the loop stops in order
};

/// Option of an output: its values are checked after each update(), before anybody reads them.
struct Finite {
    Finite() = default;
    explicit Finite(OnNonFinite on_non_finite) : policy(on_non_finite) {}
    OnNonFinite policy = OnNonFinite::Hold;
};

namespace detail {

template <typename T>
bool isFinite(const T& value) noexcept;

/// Takes the place of a stream in a message's serializer and looks at each field.
class FiniteVisitor {
   public:
    template <typename T>
    void next(const T& field) noexcept {
        if (finite_) finite_ = isFinite(field);
    }
    bool finite() const noexcept { return finite_; }

   private:
    bool finite_ = true;
};

template <typename T, typename = void>
struct IsSequence : std::false_type {};
template <typename T>
struct IsSequence<T, std::void_t<decltype(std::declval<const T&>().begin()),
                                 decltype(std::declval<const T&>().size())>> : std::true_type {};

template <typename T, typename = void>
struct HasAllFinite : std::false_type {};
template <typename T>
struct HasAllFinite<T, std::void_t<decltype(std::declval<const T&>().allFinite())>>
    : std::true_type {};

template <typename T, typename = void>
struct HasCoefficients : std::false_type {};
template <typename T>
struct HasCoefficients<T, std::void_t<decltype(std::declval<const T&>().coeffs())>>
    : std::true_type {};

template <typename T, typename = void>
struct HasMatrix : std::false_type {};
template <typename T>
struct HasMatrix<T, std::void_t<decltype(std::declval<const T&>().matrix().allFinite()),
                                typename T::LinearMatrixType>> : std::true_type {};

template <typename T>
bool isFinite(const T& value) noexcept {
    if constexpr (std::is_floating_point_v<T>) {
        return std::isfinite(value);
    } else if constexpr (HasMatrix<T>::value) {  // Eigen::Transform
        return value.matrix().allFinite();
    } else if constexpr (HasCoefficients<T>::value) {  // Eigen::Quaternion
        return value.coeffs().allFinite();
    } else if constexpr (HasAllFinite<T>::value) {  // Eigen::Matrix
        return value.allFinite();
    } else if constexpr (ros::message_traits::IsMessage<T>::value) {
        FiniteVisitor visitor;
        ros::serialization::Serializer<T>::template allInOne<FiniteVisitor, const T&>(visitor,
                                                                                      value);
        return visitor.finite();
    } else if constexpr (IsSequence<T>::value && !std::is_same_v<T, std::string>) {
        for (const auto& item : value) {
            if (!isFinite(item)) return false;
        }
        return true;
    } else {
        return true;  // text, integers, and time and duration, which are made of integers
    }
}

}  // namespace detail

}  // namespace rtcf
