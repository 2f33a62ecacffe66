/// @file
/// OROCOS' properties: a variable of a component that follows a parameter of the same name. The
/// loader, `rtcfctl set` and ROS peers set the parameter.
#pragma once

#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

#include "rtcf/component.hpp"

namespace RTT {

/// Result of addProperty() and similar functions; descriptions are ignored.
class Described {
   public:
    /// Does nothing; for source compatibility. @{
    Described& doc(const std::string&) { return *this; }
    Described& arg(const std::string&, const std::string&) { return *this; }
    /// @}
};

/// The thread that runs an operation, in OROCOS. Ignored.
enum ExecutionThread { OwnThread, ClientThread };

namespace base {

/// Base class of properties of all types.
class PropertyBase : public Described {
   public:
    virtual ~PropertyBase() = default;
    /// Copies the parameter's value to the variable if the parameter has changed. Real-time safe in
    /// the cycle, where it skips texts, as copying one may allocate.
    virtual void bring(bool in_cycle) = 0;
};

}  // namespace base

/// A property of type bool, integer, floating point or std::string.
template <typename T>
class Property final : public base::PropertyBase {
   public:
    static_assert(std::is_arithmetic_v<T> || std::is_same_v<T, std::string>,
                  "a property is a bool, an integer, a floating-point number or a std::string: get "
                  "others by getPrivateNodeHandle().getParam() in configureHook()");

    /// @param variable its present value becomes the parameter's default
    Property(::rtcf::Component* owner, std::string name, T& variable)
        : parameter_(owner, std::move(name), variable), variable_(variable), last_(variable) {}

    void bring(bool in_cycle) override {
        if (in_cycle && std::is_same_v<T, std::string>) return;
        // The component may write the variable too, so copy only a changed parameter.
        if (same(parameter_.value(), last_)) return;
        last_ = parameter_.value();
        variable_ = last_;
    }

   private:
    // Two NaN count as equal.
    static bool same(const T& a, const T& b) {
        if constexpr (std::is_floating_point_v<T>) {
            if (std::isnan(a) && std::isnan(b)) return true;
        }
        return a == b;
    }

    ::rtcf::Parameter<T> parameter_;
    T& variable_;
    T last_;
};

}  // namespace RTT
