/// @file
/// Parameters: declared once as members, then set when the component is
/// loaded and changed while the loop runs, with bounds checked beforehand.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "rtcf/realtime.hpp"

namespace rtcf {

class Component;

/// A parameter's value on its way in or out. An enumerator travels by name.
using ParameterValue = std::variant<bool, std::int64_t, double, std::string>;

/// @name Options of a parameter's declaration
/// @{
struct Min {
    explicit Min(double bound) : value(bound) {}
    double value;  ///< inclusive
};
struct Max {
    explicit Max(double bound) : value(bound) {}
    double value;  ///< inclusive
};
struct Unit {
    explicit Unit(std::string name) : value(std::move(name)) {}
    std::string value;
};
struct Doc {
    explicit Doc(std::string line) : value(std::move(line)) {}
    std::string value;
};
/// One enumerator of an enum parameter: its name and value.
struct Choice {
    template <typename E>
    Choice(std::string choice, E enumerator)
        : name(std::move(choice)), value(static_cast<std::int64_t>(enumerator)) {}
    std::string name;
    std::int64_t value;
};
/// @}

/// True for two NaN too, which do not equal each other.
inline bool sameValue(const ParameterValue& a, const ParameterValue& b) noexcept {
    const auto* x = std::get_if<double>(&a);
    const auto* y = std::get_if<double>(&b);
    return a == b || (x != nullptr && y != nullptr && std::isnan(*x) && std::isnan(*y));
}

/// How a parameter was declared.
struct ParameterDeclaration {
    std::string name;
    std::string type;  ///< "bool", "int", "double", "string" or "enum"
    ParameterValue default_value;
    std::optional<double> minimum;
    std::optional<double> maximum;
    std::string unit;
    std::string doc;
    std::vector<Choice> choices;
};

/// A value of a component with a successor, which takes its place at a cycle
/// boundary. Staged, discarded and released by the graph thread.
class StagedValue {
   public:
    StagedValue() = default;
    StagedValue(const StagedValue&) = delete;
    StagedValue& operator=(const StagedValue&) = delete;

    virtual void commit() noexcept RTCF_NONBLOCKING = 0;  ///< At the boundary; real-time safe.
    /// Lets go of what is staged, or of the value that commit() has replaced. Not real-time safe.
    virtual void release() noexcept = 0;
    bool staged() const noexcept RTCF_NONBLOCKING { return is_staged_; }

   protected:
    ~StagedValue() = default;
    bool is_staged_ = false;
};

/// What the executor handles of any parameter.
class ParameterBase : public StagedValue {
   public:
    const ParameterDeclaration& declaration() const noexcept { return declaration_; }

    /// Checks type, bounds and enumerators. @return empty if the value can be
    /// staged, else what is wrong with it. Converts int to double where a
    /// double is declared. NaN and infinity are for defaults alone, as "no limit".
    /// Not real-time safe.
    std::string check(ParameterValue& value) const;

    virtual void stage(const ParameterValue& checked) = 0;  ///< A successor. Not real-time safe.

   protected:
    ParameterBase(Component* owner, ParameterDeclaration declaration);
    virtual ~ParameterBase() = default;

    ParameterDeclaration declaration_;
};

/// A parameter of type bool, integer, floating point, std::string or enum.
template <typename T>
class Parameter final : public ParameterBase {
   public:
    /// @param owner the component, `this`
    /// @param name  ROS base name, unique among the component's parameters
    /// @param initial value unless the loader gives another
    /// @param options any of Min, Max, Unit, Doc, Choice
    template <typename... Options>
    Parameter(Component* owner, std::string name, T initial, Options... options)
        : ParameterBase(owner, declare(std::move(name), initial, std::move(options)...)),
          value_(initial),
          staged_(std::move(initial)) {}

    /// The value, constant during a cycle. Real-time safe.
    const T& value() const noexcept RTCF_NONBLOCKING { return value_; }
    operator const T&() const noexcept RTCF_NONBLOCKING {
        return value_;
    }  // NOLINT(google-explicit-constructor)

    /// The value as it will be if the batch is adopted that prepare() is about.
    const T& proposed() const noexcept { return is_staged_ ? staged_ : value_; }

    void stage(const ParameterValue& checked) override {
        is_staged_ = true;
        if constexpr (std::is_same_v<T, bool> || std::is_same_v<T, std::string>) {
            staged_ = std::get<T>(checked);
        } else if constexpr (std::is_enum_v<T>) {
            for (const Choice& choice : declaration_.choices) {
                if (choice.name == std::get<std::string>(checked))
                    staged_ = static_cast<T>(choice.value);
            }
        } else if constexpr (std::is_integral_v<T>) {
            staged_ = static_cast<T>(std::get<std::int64_t>(checked));
        } else {
            staged_ = static_cast<T>(std::get<double>(checked));
        }
    }
    void commit() noexcept RTCF_NONBLOCKING override {
        std::swap(value_, staged_);
        is_staged_ = false;
    }
    void release() noexcept override { is_staged_ = false; }

   private:
    static_assert(
        std::is_arithmetic_v<T> || std::is_enum_v<T> || std::is_same_v<T, std::string>,
        "a parameter is a bool, an integer, a floating-point number, a std::string or an enum");

    template <typename... Options>
    static ParameterDeclaration declare(std::string name, const T& initial, Options... options) {
        ParameterDeclaration declaration;
        declaration.name = std::move(name);
        (apply(declaration, std::move(options)), ...);
        if constexpr (std::is_same_v<T, bool>) {
            declaration.type = "bool";
            declaration.default_value = initial;
        } else if constexpr (std::is_same_v<T, std::string>) {
            declaration.type = "string";
            declaration.default_value = initial;
        } else if constexpr (std::is_enum_v<T>) {
            declaration.type = "enum";
            declaration.default_value = std::string();
            for (const Choice& choice : declaration.choices) {
                if (choice.value == static_cast<std::int64_t>(initial))
                    declaration.default_value = choice.name;
            }
        } else if constexpr (std::is_integral_v<T>) {
            declaration.type = "int";
            declaration.default_value = static_cast<std::int64_t>(initial);
            // A value must fit the C++ type, whatever bounds were declared.
            narrow(declaration, static_cast<double>(std::numeric_limits<T>::min()),
                   static_cast<double>(std::numeric_limits<T>::max()));
        } else {
            declaration.type = "double";
            declaration.default_value = static_cast<double>(initial);
            narrow(declaration, static_cast<double>(std::numeric_limits<T>::lowest()),
                   static_cast<double>(std::numeric_limits<T>::max()));
        }
        return declaration;
    }
    // Bounds of T, where it is smaller than what values travel as.
    static void narrow(ParameterDeclaration& declaration, double lowest, double highest) {
        constexpr bool kSmaller = sizeof(T) < sizeof(std::int64_t);
        if constexpr (kSmaller || std::is_unsigned_v<T>) {
            declaration.minimum = std::max(lowest, declaration.minimum.value_or(lowest));
        }
        if constexpr (kSmaller) {
            declaration.maximum = std::min(highest, declaration.maximum.value_or(highest));
        }
    }
    static void apply(ParameterDeclaration& declaration, Min bound) {
        declaration.minimum = bound.value;
    }
    static void apply(ParameterDeclaration& declaration, Max bound) {
        declaration.maximum = bound.value;
    }
    static void apply(ParameterDeclaration& declaration, Unit unit) {
        declaration.unit = std::move(unit.value);
    }
    static void apply(ParameterDeclaration& declaration, Doc doc) {
        declaration.doc = std::move(doc.value);
    }
    static void apply(ParameterDeclaration& declaration, Choice choice) {
        declaration.choices.push_back(std::move(choice));
    }

    T value_;
    T staged_;
};

/// The values of a component's parameters as a batch proposes them:
/// `proposed[kp]`. Those that the batch leaves alone have their present value.
class Values {
   public:
    template <typename T>
    const T& operator[](const Parameter<T>& parameter) const noexcept {
        return parameter.proposed();
    }
};

}  // namespace rtcf
