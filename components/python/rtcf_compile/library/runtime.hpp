/// @file
/// What the library of a component in Python needs besides the component API: included by the
/// source that rtcf-compile generates, by nothing else.
#pragma once

#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

namespace rtcf::python {

/// What compiled code gives for a raise: constant bytes that tell what and where.
struct Raised {
    const char* bytes;
    std::int32_t size;
};

/// What such bytes mean. Line 0: in a function called from the line that the hook noted.
struct Meaning {
    std::uint64_t hash;
    int line;
    const char* text;
};

/// A line of the Python source that may be the one that was noted.
struct SourceLine {
    int line;
    const char* text;
};

/// FNV-1a of 64 bits.
inline std::uint64_t hashOf(const char* bytes, std::int32_t size) noexcept {
    std::uint64_t value = 0xCBF29CE484222325U;
    for (std::int32_t i = 0; i < size; ++i)
        value = (value ^ static_cast<unsigned char>(bytes[i])) * 0x100000001B3U;
    return value;
}

/// "my.py:12: `x = 1 / y`: ZeroDivisionError: division by zero". Not real-time safe: the loop ends.
template <std::size_t Meanings, std::size_t Lines>
std::string say(const void* raised, std::int64_t noted, const char* file,
                const std::array<Meaning, Meanings>& meanings,
                const std::array<SourceLine, Lines>& lines) {
    const char* text = "raised what is not known";
    std::int64_t line = noted;
    if (raised != nullptr) {
        Raised what{};
        std::memcpy(&what, raised, sizeof what);
        const std::uint64_t hash = hashOf(what.bytes, what.size);
        for (const Meaning& each : meanings) {
            if (each.hash != hash) continue;
            text = each.text;
            if (each.line != 0) line = each.line;
        }
    }
    for (const SourceLine& each : lines) {
        if (each.line == line) return fmt::format("{}:{}: `{}`: {}", file, line, each.text, text);
    }
    return fmt::format("{}:{}: {}", file, line, text);
}

/// Declares a field of the record as state, as rtcf::State does with its own value. Compiled code
/// works on it in place.
template <typename T, typename Field>
void declareState(Component& component, const char* name, Field& field, const char* unit,
                  const char* doc) {
    static_assert(sizeof(T) == sizeof(Field), "a state is a field of the record");
    StateDeclaration declaration;
    declaration.name = name;
    declaration.type = StateType<T>::name();
    declaration.unit = unit;
    declaration.doc = doc;
    declaration.identity = StateType<T>::identity();
    declaration.size = sizeof(T);
    declaration.value = &field;
    declaration.initial.resize(sizeof(T));
    std::memcpy(declaration.initial.data(), static_cast<const void*>(&field), sizeof(T));
    declaration.print = [](const void* value) {
        T copy = T();
        std::memcpy(static_cast<void*>(&copy), value, sizeof(T));
        std::string text;
        StateType<T>::print(copy, text);
        return text;
    };
    component.declare(std::move(declaration));
}

/// How the record has an array: row by row.
template <typename Scalar, int Rows, int Columns>
using RowByRow =
    Eigen::Matrix<Scalar, Rows, Columns, Columns == 1 ? Eigen::ColMajor : Eigen::RowMajor>;

/// @name Between a port's value and a field of the record; real-time safe
/// @{
template <typename Scalar, int Rows, int Columns, int Options, std::size_t Count>
void load(std::array<Scalar, Count>& field,
          const Eigen::Matrix<Scalar, Rows, Columns, Options>& value) noexcept {
    Eigen::Map<RowByRow<Scalar, Rows, Columns>>(field.data()) = value;
}
template <typename T>
void load(T& field, const T& value) noexcept {
    field = value;
}
template <typename Scalar, int Rows, int Columns, int Options, std::size_t Count>
void store(Eigen::Matrix<Scalar, Rows, Columns, Options>& value,
           const std::array<Scalar, Count>& field) noexcept {
    value = Eigen::Map<const RowByRow<Scalar, Rows, Columns>>(field.data());
}
template <typename T>
void store(T& value, const T& field) noexcept {
    value = field;
}
/// @}

/// Sets a ros::Time or a ros::Duration; what it has no room for is its nearest. Real-time safe.
template <typename Time>
void setTime(Time& time, std::int64_t ns) noexcept {
    using Seconds = std::numeric_limits<decltype(time.sec)>;
    constexpr std::int64_t kSecond = 1'000'000'000;
    const std::int64_t rest = (ns % kSecond + kSecond) % kSecond;
    time.sec = static_cast<decltype(time.sec)>(
        std::clamp<std::int64_t>((ns - rest) / kSecond, Seconds::min(), Seconds::max()));
    time.nsec = static_cast<decltype(time.nsec)>(rest);
}

/// Moves the messages of a queue into the record's ring; real-time safe.
/// @tparam Elements of one message @return how many found it full, and are lost
template <std::size_t Elements, typename T, std::size_t Messages, typename Scalar>
std::uint64_t receive(Queue<T, Messages>& port, std::int64_t now_ns,
                      std::array<Scalar, Messages * Elements>& ring,
                      std::array<std::int64_t, Messages>& written, std::int64_t oldest,
                      std::int64_t& count) noexcept {
    std::uint64_t lost = 0;
    for (const T* message = port.front(); message != nullptr; port.pop(), message = port.front()) {
        if (count == static_cast<std::int64_t>(Messages)) {
            ++lost;
            continue;
        }
        const std::size_t place = static_cast<std::size_t>(oldest + count++) % Messages;
        if constexpr (std::is_arithmetic_v<T>) {
            ring[place] = *message;
        } else {
            std::array<Scalar, Elements> values;
            load(values, *message);
            std::copy(values.begin(), values.end(), ring.begin() + place * Elements);
        }
        written[place] = now_ns - port.age();
    }
    return lost;
}

}  // namespace rtcf::python
