// Computes a value from its period in prepare(), and counts the cycles that have the value of
// another period.
#include <cstdint>

#include <rtcf/component.hpp>
#include <rtcf/design_period.hpp>

namespace {

class Sampled final : public rtcf::Component {
    rtcf::Output<std::int64_t> design{this, "design", "ns"};
    rtcf::Parameter<double> longest{this, "longest", 1.0, rtcf::Unit("s"),
                                    rtcf::Doc("longest period that prepare() accepts")};
    rtcf::Derived<std::int64_t> period_{this};
    rtcf::DesignPeriod design_period_{this};
    rtcf::State<std::uint64_t> wrong_{this, "wrong", 0, rtcf::Doc("cycles with another period")};

    bool prepare(const rtcf::Values& proposed) override {
        if (design_period_.proposedSeconds() > proposed[longest])
            return fail("{} ns is too long a period", design_period_.proposed());
        period_.stage(design_period_.proposed());
        return true;
    }
    void update() override {
        if (*period_ != period()) ++wrong_;
        design.write(*period_);
    }
};

}  // namespace

RTCF_COMPONENT(Sampled, "Computes a value from its period")
