#include "state/state_value.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <type_traits>

#include "common/error.hpp"

namespace rtcf::executor {

namespace {

// Converts a value to T; unset if the conversion is not exact.
template <typename T>
std::optional<T> exactly(const ParameterValue& value) {
    if constexpr (std::is_same_v<T, bool>) {
        const auto* flag = std::get_if<bool>(&value);
        return flag != nullptr ? std::optional<T>(*flag) : std::nullopt;
    } else if constexpr (std::is_floating_point_v<T>) {
        if (const auto* number = std::get_if<double>(&value)) return static_cast<T>(*number);
        if (const auto* number = std::get_if<std::int64_t>(&value)) return static_cast<T>(*number);
        return std::nullopt;
    } else {
        const auto* number = std::get_if<std::int64_t>(&value);
        if (number == nullptr) return std::nullopt;
        const T result = static_cast<T>(*number);
        const bool fits =
            static_cast<std::int64_t>(result) == *number && (std::is_signed_v<T> || *number >= 0);
        return fits ? std::optional<T>(result) : std::nullopt;
    }
}

template <typename T>
bool store(const StateDeclaration& state, const ParameterValue& value,
           std::vector<std::byte>& bytes, bool& known) {
    if (state.type != StateType<T>::name() || state.identity != StateType<T>::identity())
        return false;
    known = true;
    const std::optional<T> exact = exactly<T>(value);
    if (!exact) return false;
    bytes.resize(sizeof *exact);
    std::memcpy(bytes.data(), &*exact, sizeof *exact);
    return true;
}

template <typename... T>
bool storeAny(const StateDeclaration& state, const ParameterValue& value,
              std::vector<std::byte>& bytes, bool& known) {
    return (store<T>(state, value, bytes, known) || ...);
}

}  // namespace

std::vector<std::byte> stateValue(const std::string& component, const StateDeclaration& state,
                                  const ParameterValue& value) {
    std::vector<std::byte> bytes;
    bool known = false;
    if (storeAny<bool, float, double, std::int8_t, std::uint8_t, std::int16_t, std::uint16_t,
                 std::int32_t, std::uint32_t, std::int64_t, std::uint64_t>(state, value, bytes,
                                                                           known))
        return bytes;
    if (!known) {
        throw Error(ErrorKind::FailedPrecondition,
                    fmt::format("state {} of {} is {}: only numbers and bools can be set; "
                                "rtcfctl reset {} resets all state",
                                state.name, component, state.type, component));
    }
    throw Error(ErrorKind::InvalidArgument, fmt::format("state {} of {} takes values of type {}",
                                                        state.name, component, state.type));
}

}  // namespace rtcf::executor
