/// @file
/// Declared state: the values that a component keeps from one cycle to the next, known to the
/// executor by name and type. A state is a plain member of the component, and costs as much.
///
///     rtcf::State<double> integral{this, "integral", 0.0, rtcf::Unit("N m")};
///     …
///     integral += ki * error * dt();
///
/// The executor hands declared state over to a component that replaces this one. `rtcfctl info`
/// shows it, `rtcfctl reset` sets it back to its initial value, and snapshots contain it. State
/// that describes the machine now, such as a latched stop or the last command of a drive, is
/// declared with rtcf::Live(): while the loop runs in real time, neither a reset nor a snapshot
/// changes it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtcf/member_owners.hpp"
#include "rtcf/parameter.hpp"
#include "rtcf/realtime.hpp"
#include "rtcf/state_type.hpp"

namespace rtcf {

class Component;

/// Option of a State: while the loop runs in real time, `rtcfctl reset` and `rtcfctl restore` leave
/// it as it is, because another value would release a stop, or make a command jump.
struct Live {};

/// Name, type and memory of a state of any type.
struct StateDeclaration {
    std::string name;
    std::string type;  ///< type for people, e.g. "double[3x1]"
    std::string unit;
    std::string doc;
    std::uint64_t identity = 0;  ///< identity of the type, see state_type.hpp
    std::size_t size = 0;        ///< bytes
    void* value = nullptr;       ///< address of the value, in the component
    std::vector<std::byte> initial;
    bool live = false;  ///< see Live
    /// Prints the value at `value` on one line. Not real-time safe.
    std::string (*print)(const void* value) = nullptr;
};

/// Most bytes of state that a component may declare, as one cycle copies them.
constexpr std::size_t kLargestState = 64 * 1024;

/// A state of an arithmetic type, an enum, a fixed-size Eigen type, a std::array of these, or a
/// trivially copyable struct that names its fields (state_type.hpp). The component writes it in
/// update() and in its other hooks.
template <typename T>
class State final {
   public:
    /// @param owner the component, `this`
    /// @param name  ROS base name, unique among the component's states
    /// @param initial value of a new component, and after a reset
    /// @param options Unit, Doc, Live
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
            // The bytes may be unaligned.
            T copy = T();
            std::memcpy(static_cast<void*>(&copy), value, sizeof(T));
            std::string text;
            StateType<T>::print(copy, text);
            return text;
        };
        declareIn(owner, std::move(declaration));
    }
    State(const State&) = delete;
    ~State() { detail::endMember(&value_); }

    /// @name Access as to a plain member; real-time safe
    /// @{
    const T& value() const noexcept RTCF_NONBLOCKING { return value_; }
    T& value() noexcept RTCF_NONBLOCKING { return value_; }
    operator const T&() const noexcept RTCF_NONBLOCKING {  // NOLINT(google-explicit-constructor)
        return value_;
    }
    const T* operator->() const noexcept RTCF_NONBLOCKING { return &value_; }
    T* operator->() noexcept RTCF_NONBLOCKING { return &value_; }

    // NOLINTNEXTLINE(bugprone-unhandled-self-assignment,modernize-use-equals-default): see below
    State& operator=(const State& other) {  // assigns the value only; the name stays
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
    static void apply(StateDeclaration& declaration, Live) { declaration.live = true; }
    static void declareIn(Component* owner, StateDeclaration declaration);

    T value_;
};

/// A view of the state and outputs of a component that is being replaced, by name and type. It
/// never gives access to the object, whose class may come from another version of the source.
class Predecessor {
   public:
    /// @param component must outlive this object
    explicit Predecessor(const Component& component) noexcept : component_(component) {}

    /// The value of a declared state. Real-time safe.
    /// @return null if there is no state of this name and type
    template <typename T>
    const T* state(std::string_view name) const noexcept {
        const StateDeclaration* found = findState(name);
        if (found == nullptr || found->size != sizeof(T) ||
            found->identity != StateType<T>::identity())
            return nullptr;
        return static_cast<const T*>(found->value);
    }

    /// The last value of an output. Real-time safe if T is also the type of one of the caller's
    /// ports.
    /// @return null if there is no output of this name and type, or it has not written
    template <typename T>
    const T* output(std::string_view name) const noexcept;

   private:
    const StateDeclaration* findState(std::string_view name) const noexcept;

    const Component& component_;
};

}  // namespace rtcf
