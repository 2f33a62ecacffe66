#include <algorithm>
#include <cmath>
#include <limits>

#include <rtcf/component.hpp>

#include "measurement_watch.hpp"

namespace rtcf_control {
namespace {

class FrictionCompensation final : public rtcf::Component {
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    rtcf::Input<double> velocity{this, "velocity"};
    rtcf::Output<double> effort{this, "effort", "", rtcf::Finite()};

    rtcf::Parameter<double> coulomb{
        this,           "coulomb",         0.0,
        rtcf::Min(0.0), rtcf::Unit("N m"), rtcf::Doc("Coulomb friction, in motion")};
    rtcf::Parameter<double> breakaway{
        this,           "breakaway",       0.0,
        rtcf::Min(0.0), rtcf::Unit("N m"), rtcf::Doc("static friction; 0 = that of coulomb")};
    rtcf::Parameter<double> viscous{this,
                                    "viscous",
                                    0.0,
                                    rtcf::Min(0.0),
                                    rtcf::Unit("N m s/rad"),
                                    rtcf::Doc("viscous friction")};
    rtcf::Parameter<double> stribeck_velocity{
        this,
        "stribeck_velocity",
        0.1,
        rtcf::Min(1e-9),
        rtcf::Unit("rad/s"),
        rtcf::Doc("velocity of the transition from breakaway to coulomb")};
    rtcf::Parameter<double> stribeck_exponent{
        this,
        "stribeck_exponent",
        2.0,
        rtcf::Min(0.1),
        rtcf::Max(10.0),
        rtcf::Doc("shape of this transition: 2 = Gaussian, 1 = exponential")};
    rtcf::Parameter<double> smoothing{
        this,
        "smoothing",
        0.01,
        rtcf::Min(1e-9),
        rtcf::Unit("rad/s"),
        rtcf::Doc("velocity at which Coulomb and static friction have 76 % of their size")};
    rtcf::Parameter<double> share{this,           "share",        1.0,
                                  rtcf::Min(0.0), rtcf::Max(1.0), rtcf::Doc("compensated share")};
    rtcf::Parameter<double> max_effort{
        this,           "max_effort",      kInfinity,
        rtcf::Min(0.0), rtcf::Unit("N m"), rtcf::Doc("largest effort, either way")};
    rtcf::Parameter<double> fade{this,
                                 "fade",
                                 0.2,
                                 rtcf::Min(0.0),
                                 rtcf::Unit("s"),
                                 rtcf::Doc("time of the transition after a change of parameters; "
                                           "0 = at once")};

    MeasurementWatch<1> watch_{this, {"velocity"}, "effort = 0"};

    struct Law {
        double coulomb = 0.0;
        double breakaway = 0.0;
        double viscous = 0.0;
        double stribeck_velocity = 1.0;
        double stribeck_exponent = 1.0;
        double smoothing = 1.0;
        double share = 0.0;

        double at(double v) const {
            const double bristles =
                std::exp(-std::pow(std::abs(v) / stribeck_velocity, stribeck_exponent));
            const double dry = coulomb + (std::max(breakaway, coulomb) - coulomb) * bristles;
            return share * (dry * std::tanh(v / smoothing) + viscous * v);
        }
        bool operator!=(const Law& other) const {
            return coulomb != other.coulomb || breakaway != other.breakaway ||
                   viscous != other.viscous || stribeck_velocity != other.stribeck_velocity ||
                   stribeck_exponent != other.stribeck_exponent || smoothing != other.smoothing ||
                   share != other.share;
        }
        template <typename Visit>
        void fields(Visit&& visit) {
            visit("coulomb", coulomb);
            visit("breakaway", breakaway);
            visit("viscous", viscous);
            visit("stribeck_velocity", stribeck_velocity);
            visit("stribeck_exponent", stribeck_exponent);
            visit("smoothing", smoothing);
            visit("share", share);
        }
    };

    rtcf::State<Law> law_{this, "law", {}, rtcf::Doc("parameters of the last cycle")};
    rtcf::State<double> offset_{this, "offset", 0.0, rtcf::Unit("N m"),
                                rtcf::Doc("difference to the law before the last change")};
    rtcf::State<double> rest_{this, "rest", 0.0,
                              rtcf::Doc("part of the transition that is left, 1 to 0")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the law has been used")};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[breakaway] == 0.0 || proposed[breakaway] >= proposed[coulomb]) return true;
        return RTCF_FAIL(this, "breakaway = {} is below coulomb = {}; 0 stands for coulomb",
                         proposed[breakaway], proposed[coulomb]);
    }

    bool start() override {
        begun_ = false;
        watch_.begin();
        return true;
    }

    void update() override {
        const rtcf::DataStatus status = velocity.read();
        if (status == rtcf::DataStatus::None) return;
        const double v = velocity.value();
        const char* const fault = watch_.note(0, v, velocity.age(this), elapsed());
        if (fault != nullptr) {
            reportFault(fault);
            if (watch_.lost(0)) safe();
            return;  // else readers keep the last effort
        }
        if (begun_ && rest_ > 0.0) rest_ = fade > 0.0 ? std::max(0.0, rest_ - dt() / fade) : 0.0;
        const Law law{coulomb,           breakaway, viscous, stribeck_velocity,
                      stribeck_exponent, smoothing, share};
        const double wanted = law.at(v);
        if (!begun_) {
            rest_ = 0.0;
            law_ = law;
        } else if (law != law_.value()) {
            offset_ = law_.value().at(v) + rest_ * offset_ - wanted;
            rest_ = fade > 0.0 ? 1.0 : 0.0;
            law_ = law;
        }
        begun_ = true;
        effort.write(std::clamp(wanted + rest_ * offset_, -max_effort, max_effort.value()));
    }

    // An effort along the motion would outlast it in the drive.
    void safe() noexcept override { effort.write(0.0); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::FrictionCompensation, "FrictionCompensation",
                     "Effort (N m) against Coulomb, viscous and Stribeck friction of a joint, "
                     "smooth at velocity 0 (Armstrong-Hélouvry, Dupont & Canudas-de-Wit, "
                     "Automatica 30, 1994)",
                     FrictionCompensation)
