/// @file
/// Parameters: members with a default value and bounds. They are set when the component is loaded
/// and may change while the loop runs. Bounds are checked before a value is applied.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "rtcf/bounded_vector.hpp"
#include "rtcf/member_owners.hpp"
#include "rtcf/realtime.hpp"

namespace rtcf {

class Component;

/// A parameter's value outside the component. The value of an enum parameter is the enumerator's
/// name.
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
/// The value does not change after the load, as the path of a device or the names of joints. `set`
/// rejects another value; `apply` replaces the component.
struct Fixed {};
/// One enumerator of an enum parameter: its name and value.
struct Choice {
    template <typename E>
    Choice(std::string choice, E enumerator)
        : name(std::move(choice)), value(static_cast<std::int64_t>(enumerator)) {}
    std::string name;
    std::int64_t value;
};
/// @}

/// True if two values are equal; two NaN count as equal. Not real-time.
inline bool sameValue(const ParameterValue& a, const ParameterValue& b) noexcept {
    const auto* x = std::get_if<double>(&a);
    const auto* y = std::get_if<double>(&b);
    return a == b || (x != nullptr && y != nullptr && std::isnan(*x) && std::isnan(*y));
}

/// Declaration of a parameter.
struct ParameterDeclaration {
    std::string name;
    std::string type;  ///< "bool", "int", "double", "string" or "enum"
    ParameterValue default_value;
    std::optional<double> minimum;
    std::optional<double> maximum;
    std::string unit;
    std::string doc;
    std::vector<Choice> choices;
    bool is_size = false;  ///< of a BoundedVector: `<vector>_size`
    bool fixed = false;    ///< see Fixed

    /// Name of the vector if this is its size, else empty. Not real-time safe.
    std::string vectorName() const {
        return is_size ? name.substr(0, name.size() - kSizeSuffix.size()) : std::string();
    }
    static constexpr std::string_view kSizeSuffix = "_size";
};

/// A value with a staged successor, which replaces it at a cycle boundary. The graph thread stages
/// and releases; the cycle thread commits.
class StagedValue {
   public:
    StagedValue() = default;
    StagedValue(const StagedValue&) = delete;
    StagedValue& operator=(const StagedValue&) = delete;

    /// Makes the staged value the present one. Cycle boundary only; real-time safe.
    virtual void commit() noexcept RTCF_NONBLOCKING = 0;
    /// Frees the staged value, or the one that commit() has replaced. Not real-time safe.
    virtual void release() noexcept = 0;
    /// True if there is a staged value. Real-time safe.
    bool staged() const noexcept RTCF_NONBLOCKING { return is_staged_; }

   protected:
    ~StagedValue() = default;
    bool is_staged_ = false;
};

/// Base class of parameters of all types.
class ParameterBase : public StagedValue {
   public:
    /// Name, type, default and bounds. Real-time safe.
    const ParameterDeclaration& declaration() const noexcept { return declaration_; }

    /// Checks the type, bounds and enumerators of a value, and converts int to double if the
    /// parameter is a double. NaN and infinity are only valid as a declared default, for "no
    /// limit". Not real-time safe.
    /// @return empty if the value can be staged, else the error in one line
    std::string check(ParameterValue& value) const;

    /// Stages a value that has passed check(). Not real-time safe.
    virtual void stage(const ParameterValue& checked) = 0;

    /// Address of the value in the component; null if it is elsewhere. Real-time safe.
    const void* place() const noexcept { return place_; }

   protected:
    ParameterBase(Component* owner, ParameterDeclaration declaration, const void* place = nullptr);
    virtual ~ParameterBase() { detail::endMember(this); }

    ParameterDeclaration declaration_;

   private:
    friend struct AbiProbe;
    const void* place_;
};

namespace detail {

/// Converts a value that has passed ParameterBase::check() to the parameter's C++ type.
template <typename T>
T typedValue(const ParameterDeclaration& declaration, const ParameterValue& checked) {
    if constexpr (std::is_same_v<T, bool> || std::is_same_v<T, std::string>) {
        return std::get<T>(checked);
    } else if constexpr (std::is_enum_v<T>) {
        for (const Choice& choice : declaration.choices) {
            if (choice.name == std::get<std::string>(checked)) return static_cast<T>(choice.value);
        }
        return T{};  // check() has found its name among the choices
    } else if constexpr (std::is_integral_v<T>) {
        return static_cast<T>(std::get<std::int64_t>(checked));
    } else {
        return static_cast<T>(std::get<double>(checked));
    }
}

/// Declaration and staged value of a parameter that is one word. Kept outside the component, so
/// that the values that each cycle touches lie close together.
template <typename T>
class ParameterSetting final : public ParameterBase {
    static_assert(sizeof(T) <= sizeof(std::uint64_t), "a number of at most 64 bits");

   public:
    ParameterSetting(Component* owner, ParameterDeclaration declaration, T& value)
        : ParameterBase(owner, std::move(declaration), &value), value_(value), staged_(value) {}

    const T& proposed() const noexcept { return is_staged_ ? staged_ : value_; }
    T copy() const noexcept {
        T value{};
        __atomic_load(&value_, &value, __ATOMIC_RELAXED);
        return value;
    }

    void stage(const ParameterValue& checked) override {
        is_staged_ = true;
        staged_ = typedValue<T>(declaration_, checked);
    }
    void commit() noexcept RTCF_NONBLOCKING override {
        __atomic_store(&value_, &staged_, __ATOMIC_RELAXED);
        is_staged_ = false;
    }
    void release() noexcept override { is_staged_ = false; }

   private:
    T& value_;
    T staged_;
};

/// The value of a parameter that is several words, in two buffers: the present value, and the next
/// or last one. commit() exchanges them by one store, so the cycle thread never waits, and a thread
/// that copies gets one value or the other.
template <typename Whole>
class ParameterBuffers {
   public:
    /// @param present is set to the present value here and by commit()
    ParameterBuffers(const Whole& initial, const Whole*& present)
        : buffers_{{initial, initial}}, present_(present) {
        present_ = buffers_.data();
    }
    ParameterBuffers(const ParameterBuffers&) = delete;
    ParameterBuffers& operator=(const ParameterBuffers&) = delete;

    const Whole& proposed() const noexcept { return is_staged_ ? buffers_[other()] : *present_; }
    Whole copy() const {
        const std::lock_guard<std::mutex> lock(mutex_);
        return *__atomic_load_n(&present_, __ATOMIC_ACQUIRE);
    }
    template <typename T>
    void stage(T& (*element)(Whole&, std::size_t), std::size_t index, T value) {
        const std::lock_guard<std::mutex> lock(mutex_);  // copy() may read this buffer
        Whole& next = buffers_[other()];
        if (!is_staged_) next = *present_;
        is_staged_ = true;
        element(next, index) = std::move(value);
    }
    void commit() noexcept RTCF_NONBLOCKING {
        if (!is_staged_) return;  // with another element
        __atomic_store_n(&present_, &buffers_[other()], __ATOMIC_RELEASE);
        is_staged_ = false;
    }
    void release() noexcept { is_staged_ = false; }

   private:
    std::size_t other() const noexcept RTCF_NONBLOCKING {
        return present_ == buffers_.data() ? 1 : 0;
    }

    std::array<Whole, 2> buffers_;
    const Whole*& present_;
    bool is_staged_ = false;
    mutable std::mutex mutex_;  // never of the cycle thread
};

/// Declaration of an element of a parameter that is several words.
template <typename T, typename Whole>
class ElementSetting final : public ParameterBase {
   public:
    using Element = T& (*)(Whole&, std::size_t);

    ElementSetting(Component* owner, ParameterDeclaration declaration,
                   ParameterBuffers<Whole>& buffers, Element element, std::size_t index = 0)
        : ParameterBase(owner, std::move(declaration)),
          buffers_(buffers),
          element_(element),
          index_(index) {}

    void stage(const ParameterValue& checked) override {
        is_staged_ = true;
        buffers_.stage(element_, index_, typedValue<T>(declaration_, checked));
    }
    void commit() noexcept RTCF_NONBLOCKING override {
        buffers_.commit();
        is_staged_ = false;
    }
    void release() noexcept override {
        buffers_.release();
        is_staged_ = false;
    }

   private:
    ParameterBuffers<Whole>& buffers_;
    const Element element_;
    const std::size_t index_;
};

/// Makes the declaration of a parameter of type T.
template <typename T>
class DeclarationOf {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T> || std::is_same_v<T, std::string>,
                  "a parameter is a bool, an integer, a floating-point number, a std::string, an "
                  "enum, or a std::array or BoundedVector of one of these");

   public:
    template <typename... Options>
    static ParameterDeclaration make(std::string name, const T& initial, Options... options) {
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
            // A value must fit the C++ type, even if the declared bounds are wider.
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

    /// A value that the options permit, 0 if possible.
    template <typename... Options>
    static T anyValid(const Options&... options) {
        const ParameterDeclaration declaration = make("any", T{}, options...);
        if constexpr (std::is_enum_v<T>) {
            const auto& choices = declaration.choices;
            return choices.empty() ? T{} : static_cast<T>(choices.front().value);
        } else if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
            double value = std::max(0.0, declaration.minimum.value_or(0.0));
            if constexpr (std::is_integral_v<T>) value = std::ceil(value);
            double highest = declaration.maximum.value_or(value);
            if constexpr (std::is_integral_v<T>) highest = std::floor(highest);
            return static_cast<T>(std::min(value, highest));
        } else {
            return T{};
        }
    }

   private:
    // Adds the bounds of T if T is narrower than the type in ParameterValue.
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
    static void apply(ParameterDeclaration& declaration, Fixed /*fixed*/) {
        declaration.fixed = true;
    }
    static void apply(ParameterDeclaration& declaration, Choice choice) {
        declaration.choices.push_back(std::move(choice));
    }
};

}  // namespace detail

/// A parameter of type bool, integer, floating point, std::string or enum. Its functions are for
/// the cycle and for hooks, except copy(), which is for all other threads.
template <typename T>
class Parameter final {
   public:
    /// @param owner the component, `this`
    /// @param name  unique among the component's parameters; a ROS base name, or a path of groups
    ///     that ends in one: `gains/p`
    /// @param initial default value
    /// @param options any of Min, Max, Unit, Doc, Fixed, Choice
    template <typename... Options>
    Parameter(Component* owner, std::string name, const T& initial, Options... options)
        : value_(initial),
          setting_(std::make_unique<detail::ParameterSetting<T>>(
              owner,
              detail::DeclarationOf<T>::make(std::move(name), initial, std::move(options)...),
              value_)) {}
    Parameter(const Parameter&) = delete;
    Parameter& operator=(const Parameter&) = delete;

    /// The value; constant during a cycle. Real-time safe.
    const T& value() const noexcept RTCF_NONBLOCKING { return value_; }
    operator const T&() const noexcept RTCF_NONBLOCKING {
        return value_;
    }  // NOLINT(google-explicit-constructor)

    /// The value, for callbacks and other threads of the component. Real-time safe.
    T copy() const noexcept RTCF_NONBLOCKING { return setting_->copy(); }
    /// The staged value, or the present one if none is staged. In prepare(); not real-time safe.
    const T& proposed() const noexcept { return setting_->proposed(); }
    /// Name, type, default and bounds. Real-time safe.
    const ParameterDeclaration& declaration() const noexcept { return setting_->declaration(); }

   private:
    friend struct AbiProbe;
    T value_;
    const std::unique_ptr<detail::ParameterSetting<T>> setting_;
};

/// A parameter that is a text.
template <>
class Parameter<std::string> final {
   public:
    /// @param owner, name, initial, options as of other parameters
    template <typename... Options>
    Parameter(Component* owner, std::string name, const std::string& initial, Options... options)
        : settings_(
              std::make_unique<Settings>(initial, present_, owner,
                                         detail::DeclarationOf<std::string>::make(
                                             std::move(name), initial, std::move(options)...))) {}
    Parameter(const Parameter&) = delete;
    Parameter& operator=(const Parameter&) = delete;

    /// The value; constant during a cycle. Real-time safe.
    const std::string& value() const noexcept RTCF_NONBLOCKING { return *present_; }
    operator const std::string&() const noexcept RTCF_NONBLOCKING {
        return *present_;
    }  // NOLINT(google-explicit-constructor)
    /// The value, for callbacks and other threads of the component. Not real-time safe.
    std::string copy() const { return settings_->buffers.copy(); }
    /// The staged value, or the present one if none is staged. In prepare(); not real-time safe.
    const std::string& proposed() const noexcept { return settings_->buffers.proposed(); }
    /// Name, type, default and bounds. Real-time safe.
    const ParameterDeclaration& declaration() const noexcept {
        return settings_->element.declaration();
    }

   private:
    friend struct AbiProbe;
    static std::string& itself(std::string& value, std::size_t /*index*/) { return value; }

    struct Settings {
        Settings(const std::string& initial, const std::string*& present, Component* owner,
                 ParameterDeclaration declaration)
            : buffers(initial, present), element(owner, std::move(declaration), buffers, &itself) {}
        detail::ParameterBuffers<std::string> buffers;
        detail::ElementSetting<std::string, std::string> element;
    };
    const std::string* present_ = nullptr;
    const std::unique_ptr<Settings> settings_;
};

/// An array parameter. Outside the component, each element is a parameter: `gain_0`, `gain_1`, as
/// those of components in Python. Elements that are set together change in the same cycle.
template <typename T, std::size_t N>
class Parameter<std::array<T, N>> final {
   public:
    using Array = std::array<T, N>;

    /// @param owner the component, `this`
    /// @param name  as of other parameters; `<name>_<index>` are unique
    /// @param initial default values
    /// @param options any of Min, Max, Unit, Doc, Fixed, Choice; they hold for each element
    template <typename... Options>
    Parameter(Component* owner, const std::string& name, const Array& initial,
              const Options&... options)
        : settings_(std::make_unique<Settings>(initial, present_)) {
        for (std::size_t i = 0; i < N; ++i) {
            settings_->elements.emplace_back(
                owner,
                detail::DeclarationOf<T>::make(name + '_' + std::to_string(i), initial[i],
                                               options...),
                settings_->buffers, &element, i);
        }
    }
    Parameter(const Parameter&) = delete;
    Parameter& operator=(const Parameter&) = delete;

    /// The values; constant during a cycle. Real-time safe.
    const Array& value() const noexcept RTCF_NONBLOCKING { return *present_; }
    operator const Array&() const noexcept RTCF_NONBLOCKING {
        return *present_;
    }  // NOLINT(google-explicit-constructor)
    /// One of the values. Real-time safe.
    const T& operator[](std::size_t index) const noexcept RTCF_NONBLOCKING {
        return (*present_)[index];
    }

    auto begin() const noexcept RTCF_NONBLOCKING { return present_->begin(); }
    auto end() const noexcept RTCF_NONBLOCKING { return present_->end(); }
    static constexpr std::size_t size() noexcept RTCF_NONBLOCKING { return N; }

    /// The values, all of one change, for callbacks and other threads of the component. Not
    /// real-time safe.
    Array copy() const { return settings_->buffers.copy(); }
    /// The staged values, and the present ones where none is staged. In prepare(); not real-time
    /// safe.
    const Array& proposed() const noexcept { return settings_->buffers.proposed(); }

   private:
    static T& element(Array& values, std::size_t index) { return values[index]; }

    struct Settings {
        Settings(const Array& initial, const Array*& present) : buffers(initial, present) {}
        detail::ParameterBuffers<Array> buffers;
        std::deque<detail::ElementSetting<T, Array>> elements;
    };
    const Array* present_ = nullptr;
    const std::unique_ptr<Settings> settings_;
};

/// A vector parameter of at most N elements. Outside the component, each element is a parameter:
/// `taps_0`, `taps_1`, and so is their number, `taps_size`. A list in a graph or launch file, or of
/// a Python bench, sets elements and number. The elements behind the end keep their values.
template <typename T, std::size_t N>
class Parameter<BoundedVector<T, N>> final {
   public:
    using Vector = BoundedVector<T, N>;

    /// @param owner the component, `this`
    /// @param name  as of other parameters; `<name>_<index>` and `<name>_size` are unique
    /// @param initial default values
    /// @param options any of Min, Max, Unit, Doc, Fixed, Choice; they hold for each element
    template <typename... Options>
    Parameter(Component* owner, const std::string& name, const Vector& initial,
              const Options&... options)
        : settings_(std::make_unique<Settings>(filled(initial, options...), present_)) {
        const Vector& whole = *present_;
        for (std::size_t i = 0; i < N; ++i) {
            settings_->elements.emplace_back(
                owner,
                detail::DeclarationOf<T>::make(name + '_' + std::to_string(i), whole.elements_[i],
                                               options...),
                settings_->buffers, &element, i);
        }
        auto size = detail::DeclarationOf<std::int64_t>::make(
            name + std::string(ParameterDeclaration::kSizeSuffix), whole.size_, Min(0.0),
            Max(static_cast<double>(N)), Doc("number of elements of " + name));
        size.is_size = true;
        size.fixed = !settings_->elements.empty() && settings_->elements[0].declaration().fixed;
        settings_->size.emplace(owner, std::move(size), settings_->buffers, &sizeOf);
    }
    Parameter(const Parameter&) = delete;
    Parameter& operator=(const Parameter&) = delete;

    /// The values; constant during a cycle. Real-time safe.
    const Vector& value() const noexcept RTCF_NONBLOCKING { return *present_; }
    operator const Vector&() const noexcept RTCF_NONBLOCKING {
        return *present_;
    }  // NOLINT(google-explicit-constructor)
    /// One of the values. Real-time safe.
    /// @param index below size()
    const T& operator[](std::size_t index) const noexcept RTCF_NONBLOCKING {
        return (*present_)[index];
    }

    auto begin() const noexcept RTCF_NONBLOCKING { return present_->begin(); }
    auto end() const noexcept RTCF_NONBLOCKING { return present_->end(); }
    std::size_t size() const noexcept RTCF_NONBLOCKING { return present_->size(); }
    bool empty() const noexcept RTCF_NONBLOCKING { return present_->empty(); }

    /// The values, all of one change, for callbacks and other threads of the component. Not
    /// real-time safe.
    Vector copy() const { return settings_->buffers.copy(); }
    /// The staged values, and the present ones where none is staged. In prepare(); not real-time
    /// safe.
    const Vector& proposed() const noexcept { return settings_->buffers.proposed(); }

   private:
    static T& element(Vector& vector, std::size_t index) { return vector.elements_[index]; }
    static std::int64_t& sizeOf(Vector& vector, std::size_t /*index*/) { return vector.size_; }
    // The elements behind the end must be valid, too.
    template <typename... Options>
    static Vector filled(Vector vector, const Options&... options) {
        std::fill(vector.elements_.begin() + vector.size_, vector.elements_.end(),
                  vector.empty() ? detail::DeclarationOf<T>::anyValid(options...)
                                 : vector.elements_[vector.size() - 1]);
        return vector;
    }

    struct Settings {
        Settings(const Vector& initial, const Vector*& present) : buffers(initial, present) {}
        detail::ParameterBuffers<Vector> buffers;
        std::deque<detail::ElementSetting<T, Vector>> elements;
        std::optional<detail::ElementSetting<std::int64_t, Vector>> size;
    };
    const Vector* present_ = nullptr;
    const std::unique_ptr<Settings> settings_;
};

/// The values that a component's parameters will have if a batch is applied: `proposed[kp]`. A
/// parameter that is not in the batch has its present value. Not real-time.
class Values {
   public:
    template <typename T>
    const T& operator[](const Parameter<T>& parameter) const {
        return parameter.proposed();
    }
};

}  // namespace rtcf
