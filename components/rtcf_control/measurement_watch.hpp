/// @file
/// Limit on the age of a component's measured inputs, against driving on with a dead sensor. Part
/// of its component, which calls it in each cycle and writes its safe output while an input is
/// lost.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include <Eigen/Core>

#include <rtcf/component.hpp>

namespace rtcf_control {

/// @tparam Count number of inputs
template <std::size_t Count>
class MeasurementWatch {
   public:
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    /// @param names   of the inputs, for reports
    /// @param timeout default of measurement_timeout, s
    /// @param effect  safe output while an input is lost, for reports, e.g. "out = 0"
    MeasurementWatch(rtcf::Component* owner, const std::array<std::string, Count>& names,
                     const std::string& effect, double timeout = 0.2)
        : timeout_(owner, "measurement_timeout", timeout, rtcf::Min(0.0), rtcf::Unit("s"),
                   rtcf::Doc("longest time without a new finite measured value, then: " + effect)),
          frozen_timeout_(owner, "frozen_timeout", kInfinity, rtcf::Min(0.0), rtcf::Unit("s"),
                          rtcf::Doc("the same for a measured value that does not change")),
          silence_(owner, "silence", Times::Zero(), rtcf::Unit("ns"),
                   rtcf::Doc("age of the last finite value of each measured input")),
          unchanged_(owner, "unchanged", Times::Zero(), rtcf::Unit("ns"),
                     rtcf::Doc("time since the last change of each measured input")),
          last_(owner, "last_finite", none(),
                rtcf::Doc("last finite value of each measured input; NaN = none")) {
        for (std::size_t i = 0; i < Count; ++i) {
            not_finite_[i] = names[i] + " is not finite";
            late_[i] = names[i] + " has no new value within measurement_timeout: " + effect;
            frozen_[i] = names[i] + " has not changed within frozen_timeout: " + effect;
        }
    }

    /// All functions are real-time safe.
    void begin() noexcept {
        silence_->setZero();
        unchanged_->setZero();
        last_ = none();
    }
    /// Notes the value of a cycle. Once per cycle for each input that is in use and has a value.
    /// @param age      of the value, Input::age(), ns
    /// @param elapsed  of the component, ns
    /// @return the text of a fault, null = none
    const char* note(std::size_t i, double value, std::int64_t age, std::int64_t elapsed) noexcept {
        const auto at = static_cast<Eigen::Index>(i);
        const bool finite = std::isfinite(value);
        const bool changed = finite && value != last_.value()[at];
        std::int64_t& silence = silence_.value()[at];
        std::int64_t& unchanged = unchanged_.value()[at];
        silence = finite ? age : silence + elapsed;
        unchanged = changed ? age : unchanged + elapsed;
        if (finite) last_.value()[at] = value;
        if (late(i)) return late_[i].c_str();
        if (frozen(i)) return frozen_[i].c_str();
        return finite ? nullptr : not_finite_[i].c_str();
    }
    /// True if an input is lost: too old, or frozen.
    bool lost(std::size_t i) const noexcept { return late(i) || frozen(i); }
    /// Age of the last finite value, ns.
    std::int64_t silence(std::size_t i) const noexcept {
        return silence_.value()[static_cast<Eigen::Index>(i)];
    }
    /// True if an input has had a finite value.
    bool valid(std::size_t i) const noexcept { return std::isfinite(last(i)); }
    /// The last finite value; NaN = none.
    double last(std::size_t i) const noexcept {
        return last_.value()[static_cast<Eigen::Index>(i)];
    }
    /// measurement_timeout, s.
    double timeout() const noexcept { return timeout_; }

   private:
    using Times = Eigen::Matrix<std::int64_t, static_cast<int>(Count), 1>;
    using Numbers = Eigen::Matrix<double, static_cast<int>(Count), 1>;

    static Numbers none() { return Numbers::Constant(std::numeric_limits<double>::quiet_NaN()); }
    static bool above(std::int64_t time_ns, double limit_s) noexcept {
        return static_cast<double>(time_ns) > 1e9 * limit_s;
    }
    bool late(std::size_t i) const noexcept {
        return above(silence_.value()[static_cast<Eigen::Index>(i)], timeout_);
    }
    bool frozen(std::size_t i) const noexcept {
        return above(unchanged_.value()[static_cast<Eigen::Index>(i)], frozen_timeout_);
    }

    rtcf::Parameter<double> timeout_;
    rtcf::Parameter<double> frozen_timeout_;
    rtcf::State<Times> silence_;
    rtcf::State<Times> unchanged_;
    rtcf::State<Numbers> last_;
    std::array<std::string, Count> not_finite_;
    std::array<std::string, Count> late_;
    std::array<std::string, Count> frozen_;
};

}  // namespace rtcf_control
