/// @file
/// Declared state: what a component remembers from one cycle to the next, known by name and type.
/// It costs what a plain member costs, and is a plain member in the component's memory.
///
///     rtcf::State<double> integral{this, "integral", 0.0, rtcf::Unit("N m")};
///     …
///     integral += ki * error * dt();
///
/// Declared state goes over to a component that replaces this one, is shown by `rtcfctl info`,
/// and goes back to its initial value by `rtcfctl reset`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtcf/parameter.hpp"
#include "rtcf/realtime.hpp"
#include "rtcf/state_type.hpp"

namespace rtcf {

class Component;

/// What the executor handles of any state.
struct StateDeclaration {
    std::string name;
    std::string type;  ///< for people, e.g. "double[3x1]"
    std::string unit;
    std::string doc;
    std::uint64_t identity = 0;  ///< of the type; see state_type.hpp
    std::size_t size = 0;        ///< bytes
    void* value = nullptr;       ///< in the component
    std::vector<std::byte> initial;
    /// The value of such bytes as text of one line. Not real-time safe.
    std::string (*print)(const void* value) = nullptr;
};

/// The most bytes of state that one component declares: what a cycle may copy.
constexpr std::size_t kLargestState = 64 * 1024;

/// A state of an arithmetic type, an enum, a fixed-size Eigen type, a std::array of these, or a
/// trivially copyable struct that names its fields (state_type.hpp). Written by the component in
/// update() and in its hooks.
template <typename T>
class State final {
   public:
    /// @param owner the component, `this`
    /// @param name  ROS base name, unique among the component's states
    /// @param initial value of a new component, and after a reset
    /// @param options Unit, Doc
    template <typename... Options>
    // NOLINTNEXTLINE(modernize-pass-by-value): T may be large
    State(Component* owner, std::string name, const T& initial, Options... options)
        : value_(initial) {
        StateDeclaration declaration;
        declaration.name = std::move(name);
        declaration.type = StateType<T>::name();
        (apply(declaration, std::move(options)), ...);
        declaration.identity = StateType<T>::identity();
        declaration.size = sizeof(T);
        declaration.value = &value_;
        declaration.initial.resize(sizeof(T));
        std::memcpy(declaration.initial.data(), static_cast<const void*>(&value_), sizeof(T));
        declaration.print = [](const void* value) {
            // The bytes may lie anywhere; a T may want its alignment.
            T copy = T();
            std::memcpy(static_cast<void*>(&copy), value, sizeof(T));
            std::string text;
            StateType<T>::print(copy, text);
            return text;
        };
        declareIn(owner, std::move(declaration));
    }
    State(const State&) = delete;
    ~State() = default;

    /// @name As the plain member that it is; real-time safe
    /// @{
    const T& value() const noexcept RTCF_NONBLOCKING { return value_; }
    T& value() noexcept RTCF_NONBLOCKING { return value_; }
    operator const T&() const noexcept RTCF_NONBLOCKING {  // NOLINT(google-explicit-constructor)
        return value_;
    }
    const T* operator->() const noexcept RTCF_NONBLOCKING { return &value_; }
    T* operator->() noexcept RTCF_NONBLOCKING { return &value_; }

    // NOLINTNEXTLINE(bugprone-unhandled-self-assignment,modernize-use-equals-default): see below
    State& operator=(const State& other) {  // the value alone: the name stays
        value_ = other.value_;
        return *this;
    }
    template <typename U>
    State& operator=(const U& other) {
        value_ = other;
        return *this;
    }
    template <typename U>
    State& operator+=(const U& other) {
        value_ += other;
        return *this;
    }
    template <typename U>
    State& operator-=(const U& other) {
        value_ -= other;
        return *this;
    }
    template <typename U>
    State& operator*=(const U& other) {
        value_ *= other;
        return *this;
    }
    template <typename U>
    State& operator/=(const U& other) {
        value_ /= other;
        return *this;
    }
    T& operator++() noexcept { return ++value_; }
    T operator++(int) noexcept { return value_++; }
    T& operator--() noexcept { return --value_; }
    T operator--(int) noexcept { return value_--; }
    /// @}

   private:
    static void apply(StateDeclaration& declaration, Unit unit) {
        declaration.unit = std::move(unit.value);
    }
    static void apply(StateDeclaration& declaration, Doc doc) {
        declaration.doc = std::move(doc.value);
    }
    static void declareIn(Component* owner, StateDeclaration declaration);

    T value_;
};

/// What a component that is replaced leaves to its successor, by name and type: never the object
/// itself, as its class may have been built from other source.
class Predecessor {
   public:
    /// @param component lives as long as this
    explicit Predecessor(const Component& component) noexcept : component_(component) {}

    /// The value of a declared state. Real-time safe. @return null if it has none of that name, or
    /// of another type
    template <typename T>
    const T* state(std::string_view name) const noexcept {
        const StateDeclaration* found = findState(name);
        if (found == nullptr || found->size != sizeof(T) ||
            found->identity != StateType<T>::identity())
            return nullptr;
        return static_cast<const T*>(found->value);
    }

    /// The value that an output wrote last. Real-time safe if T is the type of a port of your own.
    /// @return null if it has none of that name, of another type, or wrote none
    template <typename T>
    const T* output(std::string_view name) const noexcept;

   private:
    const StateDeclaration* findState(std::string_view name) const noexcept;

    const Component& component_;
};

}  // namespace rtcf
