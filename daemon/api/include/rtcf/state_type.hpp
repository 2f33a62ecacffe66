/// @file
/// Types of declared state: numbers, enums, fixed-size Eigen types, std::array of these, and
/// trivially copyable structs that name their fields:
///
///     struct Biquad {
///         double x1 = 0.0, x2 = 0.0;
///         template <typename Visit>
///         void fields(Visit&& visit) {
///             visit("x1", x1);
///             visit("x2", x2);
///         }
///     };
///
/// Two states of equal identity and size have the same layout, byte for byte, even in libraries
/// that were built at different times. The identity of a struct contains the names, types and
/// offsets of its fields, that of an enum its enumerators from 0 to 31, if it names its underlying
/// type or is an `enum class`.
#pragma once

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "rtcf/realtime.hpp"

namespace rtcf {

/// Makes a type a state type. A specialisation has
///  - `static std::uint64_t identity() noexcept`, real-time safe
///  - `static std::string name()`, not real-time safe
///  - `static void print(const T&, std::string&)`, which appends one line; not real-time safe
template <typename T, typename Enable = void>
struct StateType;

namespace detail {

constexpr std::uint64_t stateHash(std::string_view text, std::uint64_t seed) noexcept {
    // FNV-1a: http://www.isthe.com/chongo/tech/comp/fnv
    for (const char c : text) seed = (seed ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
    return seed;
}
constexpr std::uint64_t stateHash(std::string_view text) noexcept {
    return stateHash(text, 0xcbf29ce484222325ULL);
}
constexpr std::uint64_t stateHash(std::uint64_t number, std::uint64_t seed) noexcept {
    for (int i = 0; i < 8; ++i) seed = (seed ^ ((number >> (8 * i)) & 0xff)) * 0x100000001b3ULL;
    return seed;
}

/// The name of a type without its scope; the same with all compilers.
template <typename T>
constexpr std::string_view ownName() noexcept {
    std::string_view text = __PRETTY_FUNCTION__;
    text.remove_prefix(text.find("T = ") + 4);
    text = text.substr(0, text.find_first_of(";]"));
    const std::size_t scope = text.rfind("::");
    return scope == std::string_view::npos ? text : text.substr(scope + 2);
}

/// True if an enum has an underlying type that its enumerators do not change: any number of that
/// type is a value of the enum.
template <typename E, typename = void>
struct HasFixedType : std::false_type {};
template <typename E>
struct HasFixedType<E, std::void_t<decltype(E{0})>> : std::true_type {};

/// The name of an enumerator; empty if no enumerator has this value.
template <typename E, E Value>
constexpr std::string_view enumerator() noexcept {
    std::string_view text = __PRETTY_FUNCTION__;
    text.remove_prefix(text.find("Value = ") + 8);
    text = text.substr(0, text.find_first_of(";]"));
    // `(scope::Mode)5`, but `scope::Mode::Run`.
    const std::size_t cast = text.rfind(')');
    if (cast != std::string_view::npos &&
        text.find_first_not_of("-0123456789", cast + 1) == std::string_view::npos)
        return {};
    const std::size_t scope = text.rfind("::");
    return scope == std::string_view::npos ? text : text.substr(scope + 2);
}

/// Enumerators of these values are part of an enum's identity.
constexpr int kEnumerators = 32;

template <typename E, int... Values>
constexpr std::uint64_t enumeratorsHash(std::uint64_t hash,
                                        std::integer_sequence<int, Values...> /*values*/) noexcept {
    const auto add = [&hash](std::string_view name, std::uint64_t value) {
        if (!name.empty()) hash = stateHash(value, stateHash(name, hash));
    };
    (add(enumerator<E, static_cast<E>(Values)>(), std::uint64_t{Values}), ...);
    return hash;
}

template <typename T, typename = void>
struct IsEigenMatrix : std::false_type {};
template <typename T>
struct IsEigenMatrix<
    T, std::void_t<typename T::Scalar, typename T::PlainObject, decltype(T::SizeAtCompileTime)>>
    : std::true_type {};

template <typename T, typename = void>
struct IsEigenQuaternion : std::false_type {};
template <typename T>
struct IsEigenQuaternion<T, std::void_t<typename T::Scalar, typename T::Coefficients>>
    : std::true_type {};

template <typename T, typename = void>
struct IsEigenTransform : std::false_type {};
template <typename T>
struct IsEigenTransform<T, std::void_t<typename T::Scalar, typename T::LinearMatrixType>>
    : std::true_type {};

struct AnyField {
    template <typename T>
    void operator()(const char*, T&) const noexcept {}
};
template <typename T, typename = void>
struct NamesFields : std::false_type {};
template <typename T>
struct NamesFields<T, std::void_t<decltype(std::declval<T&>().fields(AnyField{}))>>
    : std::true_type {};

template <typename Matrix>
void printMatrix(const Matrix& value, std::string& text) {
    text += '[';
    for (int row = 0; row < value.rows(); ++row) {
        if (row != 0) text += "; ";
        for (int col = 0; col < value.cols(); ++col)
            text += fmt::format("{}{}", col == 0 ? "" : ", ", value(row, col));
    }
    text += ']';
}

}  // namespace detail

template <typename T>
struct StateType<T, std::enable_if_t<std::is_arithmetic_v<T>>> {
    static constexpr std::uint64_t identity() noexcept {
        return detail::stateHash(sizeof(T), detail::stateHash(kind()));
    }
    static std::string name() {
        if constexpr (std::is_same_v<T, bool>) {
            return "bool";
        } else if constexpr (std::is_floating_point_v<T>) {
            return sizeof(T) == sizeof(float) ? "float" : "double";
        } else {
            return fmt::format("{}{}", kind(), 8 * sizeof(T));
        }
    }
    static void print(const T& value, std::string& text) { text += fmt::format("{}", +value); }

   private:
    static_assert(!std::is_same_v<T, long double>, "a state is a float or a double");
    static constexpr std::string_view kind() noexcept {
        if constexpr (std::is_same_v<T, bool>) return "bool";
        if constexpr (std::is_floating_point_v<T>) return "float";
        return std::is_signed_v<T> ? "int" : "uint";
    }
};

template <typename T>
struct StateType<T, std::enable_if_t<std::is_enum_v<T>>> {
    using Number = std::underlying_type_t<T>;
    static constexpr std::uint64_t identity() noexcept {
        const std::uint64_t hash =
            detail::stateHash(detail::ownName<T>(), StateType<Number>::identity());
        if constexpr (detail::HasFixedType<T>::value) {
            return detail::enumeratorsHash<T>(
                hash, std::make_integer_sequence<int, detail::kEnumerators>());
        } else {
            return hash;
        }
    }
    static std::string name() { return std::string(detail::ownName<T>()); }
    static void print(const T& value, std::string& text) {
        StateType<Number>::print(static_cast<Number>(value), text);
    }
};

/// Matrices and vectors; quaternions and transforms by their coefficients.
template <typename T>
struct StateType<T, std::enable_if_t<detail::IsEigenMatrix<T>::value>> {
    static_assert(T::SizeAtCompileTime > 0, "a state has a fixed size");
    static constexpr std::uint64_t identity() noexcept {
        std::uint64_t hash = StateType<typename T::Scalar>::identity();
        hash = detail::stateHash(static_cast<std::uint64_t>(T::RowsAtCompileTime), hash);
        hash = detail::stateHash(static_cast<std::uint64_t>(T::ColsAtCompileTime), hash);
        return detail::stateHash(static_cast<std::uint64_t>(T::IsRowMajor), hash);
    }
    static std::string name() {
        constexpr bool kByRows = T::IsRowMajor != 0 && T::RowsAtCompileTime > 1;
        return fmt::format("{}[{}x{}{}]", StateType<typename T::Scalar>::name(),
                           static_cast<int>(T::RowsAtCompileTime),
                           static_cast<int>(T::ColsAtCompileTime), kByRows ? ",RowMajor" : "");
    }
    static void print(const T& value, std::string& text) { detail::printMatrix(value, text); }
};

template <typename T>
struct StateType<T, std::enable_if_t<detail::IsEigenQuaternion<T>::value>> {
    static constexpr std::uint64_t identity() noexcept {
        return detail::stateHash("quaternion", StateType<typename T::Scalar>::identity());
    }
    static std::string name() { return "quaternion"; }
    static void print(const T& value, std::string& text) {  // x, y, z, w
        detail::printMatrix(value.coeffs().transpose(), text);
    }
};

template <typename T>
struct StateType<T, std::enable_if_t<detail::IsEigenTransform<T>::value>> {
    static constexpr std::uint64_t identity() noexcept {
        return detail::stateHash("transform", StateType<typename T::MatrixType>::identity());
    }
    static std::string name() { return "transform"; }
    static void print(const T& value, std::string& text) {
        detail::printMatrix(value.matrix(), text);
    }
};

template <typename T, std::size_t Count>
struct StateType<std::array<T, Count>> {
    static std::uint64_t identity() noexcept {
        return detail::stateHash(Count, detail::stateHash("array", StateType<T>::identity()));
    }
    static std::string name() { return fmt::format("{}[{}]", StateType<T>::name(), Count); }
    static void print(const std::array<T, Count>& value, std::string& text) {
        text += '[';
        for (std::size_t i = 0; i < Count; ++i) {
            if (i != 0) text += ", ";
            StateType<T>::print(value[i], text);
        }
        text += ']';
    }
};

template <typename T>
struct StateType<T, std::enable_if_t<detail::NamesFields<T>::value>> {
    static_assert(std::is_trivially_copyable_v<T>, "a state is copied byte by byte");

    static std::uint64_t identity() noexcept {
        T object{};
        Identity visitor{&object, detail::stateHash("struct")};
        object.fields(visitor);
        return visitor.hash;
    }
    static std::string name() {
        T object{};
        Names visitor;
        object.fields(visitor);
        return visitor.text + "}";
    }
    static void print(const T& value, std::string& text) {
        T copy = value;
        Print visitor{text};
        copy.fields(visitor);
        text += '}';
    }

   private:
    struct Identity {
        const void* object;
        std::uint64_t hash;
        template <typename Field>
        void operator()(const char* name, const Field& field) noexcept {
            hash = detail::stateHash(name, hash);
            hash = detail::stateHash(StateType<Field>::identity(), hash);
            hash =
                detail::stateHash(static_cast<std::uint64_t>(reinterpret_cast<const char*>(&field) -
                                                             static_cast<const char*>(object)),
                                  hash);
        }
    };
    struct Names {
        std::string text = "{";
        template <typename Field>
        void operator()(const char* name, const Field&) {
            text += fmt::format("{}{}: {}", text.size() == 1 ? "" : ", ", name,
                                StateType<Field>::name());
        }
    };
    struct Print {
        explicit Print(std::string& to) : text(to) { text += '{'; }
        std::string& text;
        bool first = true;
        template <typename Field>
        void operator()(const char* name, const Field& field) {
            text += fmt::format("{}{}: ", std::exchange(first, false) ? "" : ", ", name);
            StateType<Field>::print(field, text);
        }
    };
};

}  // namespace rtcf
