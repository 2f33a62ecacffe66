/// @file
/// Check of values for NaN and infinity. It covers numbers, Eigen types, any ROS message (roscpp's
/// serializer visits its fields), structs that name their fields (as in state_type.hpp), and
/// sequences of these. Outputs of other types cannot be declared Finite.
#pragma once

#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <ros/time.h>

#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include "rtcf/state_type.hpp"

namespace rtcf {

/// Policy for values that are not finite, on an output declared Finite.
enum class OnNonFinite {
    Hold,  ///< readers keep the last finite value, and the component is reported as faulted
    Stop,  ///< the loop also stops in order
};

/// Option of an output: the executor checks each value after update(), before readers see it. A
/// struct must name its fields.
struct Finite {
    Finite() = default;
    explicit Finite(OnNonFinite on_non_finite) : policy(on_non_finite) {}
    OnNonFinite policy = OnNonFinite::Hold;
};

namespace detail {

template <typename T>
bool isFinite(const T& value) noexcept;

/// Replaces the stream in a message's serializer, and checks each field.
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

/// Checks the named fields of a struct.
struct FiniteFields {
    bool finite = true;
    template <typename Field>
    void operator()(const char* name, const Field& field) noexcept;
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
    } else if constexpr (NamesFields<T>::value) {
        FiniteFields visitor;
        const_cast<T&>(value).fields(visitor);  // the visitor does not change the fields
        return visitor.finite;
    } else {
        return true;  // either without floating-point numbers, or not declared Finite
    }
}

template <typename Field>
void FiniteFields::operator()(const char* /*name*/, const Field& field) noexcept {
    if (finite) finite = isFinite(field);
}

/// A sequence whose items isFinite() visits one by one.
template <typename T>
constexpr bool kHasItems =
    IsSequence<T>::value && !HasAllFinite<T>::value && !ros::message_traits::IsMessage<T>::value &&
    !std::is_same_v<T, std::string>;
template <typename T>
using ItemOf = std::decay_t<decltype(*std::declval<const T&>().begin())>;

/// True if isFinite() checks all numbers of a type. For a struct, requireCheckable() tests each
/// field.
template <typename T, typename = void>
struct IsCheckable
    : std::bool_constant<std::is_arithmetic_v<T> || std::is_enum_v<T> || HasMatrix<T>::value ||
                         HasCoefficients<T>::value || HasAllFinite<T>::value ||
                         ros::message_traits::IsMessage<T>::value ||
                         std::is_same_v<T, std::string> || std::is_same_v<T, ros::Time> ||
                         std::is_same_v<T, ros::Duration> || NamesFields<T>::value> {};
template <typename T>
struct IsCheckable<T, std::enable_if_t<kHasItems<T>>> : IsCheckable<ItemOf<T>> {};

template <typename T>
void requireCheckable();

struct CheckableFields {
    template <typename Field>
    void operator()(const char* /*name*/, const Field& /*field*/) const {
        requireCheckable<Field>();
    }
};

/// Fails to compile for a type that isFinite() cannot check.
template <typename T>
void requireCheckable() {
    static_assert(IsCheckable<T>::value,
                  "rtcf::Finite cannot check this type: name its fields by a member "
                  "`template <typename Visit> void fields(Visit&& visit)`, see state_type.hpp");
    if constexpr (kHasItems<T>) {
        (void)&requireCheckable<ItemOf<T>>;
    } else if constexpr (NamesFields<T>::value) {
        // Compiled, but never called.
        (void)static_cast<void (*)(T&)>([](T& value) { value.fields(CheckableFields{}); });
    }
}

}  // namespace detail

}  // namespace rtcf
