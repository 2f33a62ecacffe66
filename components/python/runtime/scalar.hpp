/// @file
/// From the number of an element's type to the C++ type.
#pragma once

#include <cstdint>
#include <stdexcept>

#include "tables.hpp"

namespace rtcf::python {

/// Calls `use(T())` with a value of that type, and returns what it returns.
template <typename Use>
decltype(auto) withScalar(Scalar scalar, Use&& use) {
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
    throw std::logic_error("no scalar of this number");
}

/// Calls `use(float())` or `use(double())`.
template <typename Use>
decltype(auto) withFloat(Scalar scalar, Use&& use) {
    return scalar == Scalar::Float ? use(float()) : use(double());
}

}  // namespace rtcf::python
