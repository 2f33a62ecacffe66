/// @file
/// The period for which a component computes derived values: a discretised model, the gain of a
/// filter. Include this header beside component.hpp.
///
///     rtcf::Derived<Model> model{this};
///     rtcf::DesignPeriod design_period{this};
///
///     bool prepare(const rtcf::Values& proposed) override {
///         model.stage(discretise(proposed[pole], design_period.proposed()));
///         return true;
///     }
///
/// Before the loop's frequency changes, the executor calls prepare() of each component with such a
/// member, outside the real-time thread. The derived values change in the same cycle as the period.
/// If prepare() fails, the new frequency is rejected.
#pragma once

#include <cstdint>
#include <utility>

#include "rtcf/component.hpp"

namespace rtcf {

/// A component may have several: its base classes may have theirs.
class DesignPeriod final : public DerivedBase {
   public:
    /// @param owner the component, `this`
    explicit DesignPeriod(Component* owner) : DerivedBase(owner), owner_(owner) {}

    /// The component's period from the next change on, ns. In prepare(), instead of
    /// Component::period(); not real-time safe.
    std::int64_t proposed() const noexcept { return is_staged_ ? staged_ : owner_->period(); }
    /// proposed() in s. In prepare(); not real-time safe.
    double proposedSeconds() const noexcept { return 1e-9 * static_cast<double>(proposed()); }

    /// @name For the executor
    /// @{
    bool propose(std::int64_t period_ns) noexcept override {
        staged_ = period_ns;
        is_staged_ = true;
        return true;
    }
    void commit() noexcept RTCF_NONBLOCKING override { is_staged_ = false; }
    void release() noexcept override { is_staged_ = false; }
    /// @}

   private:
    Component* owner_;
    std::int64_t staged_ = 0;
};

}  // namespace rtcf
