/// @file
/// Values that a component computes from its parameters: filter coefficients, a discretised model,
/// a table. prepare() computes them outside the real-time thread; they take effect together with
/// the parameters, at one cycle boundary.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "rtcf/member_owners.hpp"
#include "rtcf/parameter.hpp"
#include "rtcf/realtime.hpp"

namespace rtcf {

class Component;

/// Base class of derived values of all types.
class DerivedBase : public StagedValue {
   public:
    /// Proposes the component's next period, ns, before prepare(). Not real-time safe.
    /// @return true if the component computes values for its period
    virtual bool propose(std::int64_t period_ns) noexcept {
        (void)period_ns;
        return false;
    }

   protected:
    explicit DerivedBase(Component* owner);
    ~DerivedBase() { detail::endMember(this); }
};

/// A derived value of any type. If it owns memory, that memory is freed outside the real-time
/// thread.
template <typename T>
class Derived final : public DerivedBase {
   public:
    /// @param owner the component, `this`
    /// @param initial value before the first prepare()
    explicit Derived(Component* owner, T initial = T{})
        : DerivedBase(owner), value_(std::make_unique<T>(std::move(initial))) {}

    /// The value, constant during a cycle. Real-time safe.
    const T& value() const noexcept RTCF_NONBLOCKING { return *value_; }
    /// Like value(). Real-time safe.
    const T& operator*() const noexcept RTCF_NONBLOCKING { return *value_; }
    /// Like value(). Real-time safe.
    const T* operator->() const noexcept RTCF_NONBLOCKING { return value_.get(); }

    /// Stages the next value. In prepare(); not real-time safe.
    void stage(T value) {
        other_ = std::make_unique<T>(std::move(value));
        is_staged_ = true;
    }

   private:
    void commit() noexcept RTCF_NONBLOCKING override {
        std::swap(value_, other_);
        is_staged_ = false;
    }
    void release() noexcept override {
        other_.reset();
        is_staged_ = false;
    }

    std::unique_ptr<T> value_;
    std::unique_ptr<T> other_;  // the staged value, or the replaced one before it is freed
};

}  // namespace rtcf
