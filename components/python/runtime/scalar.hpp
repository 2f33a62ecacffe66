/// @file
/// Maps the enumerator of an element's type to the C++ type.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <stdexcept>

#include "tables.hpp"

namespace rtcf::python {

/// Calls `use(T())`, where T is the C++ type of the scalar. @return the result of `use`
template <typename Use>
decltype(auto) withScalar(Scalar scalar, Use&& use) {
    // NOLINTBEGIN(bugprone-branch-clone): branches differ by type
    switch (scalar) {
        case Scalar::Bool:
            return use(bool());
        case Scalar::Int8:
            return use(std::int8_t());
        case Scalar::Int16:
            return use(std::int16_t());
        case Scalar::Int32:
            return use(std::int32_t());
        case Scalar::Int64:
            return use(std::int64_t());
        case Scalar::UInt8:
            return use(std::uint8_t());
        case Scalar::UInt16:
            return use(std::uint16_t());
        case Scalar::UInt32:
            return use(std::uint32_t());
        case Scalar::UInt64:
            return use(std::uint64_t());
        case Scalar::Float:
            return use(float());
        case Scalar::Double:
            return use(double());
    }
    // NOLINTEND(bugprone-branch-clone)
    throw std::logic_error("unknown scalar type");
}

/// Calls `use(float())` or `use(double())`. @return the result of `use`
template <typename Use>
decltype(auto) withFloat(Scalar scalar, Use&& use) {
    if (scalar == Scalar::Float) return use(float());
    return use(double());
}

/// Size of an element in bytes. Real-time safe.
inline std::size_t sizeOf(Scalar scalar) noexcept {
    constexpr std::array<std::size_t, 11> kSizes{1, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8};
    return kSizes[static_cast<std::size_t>(scalar)];
}

}  // namespace rtcf::python
