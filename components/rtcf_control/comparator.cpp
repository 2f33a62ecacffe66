#include <cmath>

#include <rtcf/component.hpp>

namespace rtcf_control {
namespace {

enum class Relation { Above, Below, Within };

class Comparator final : public rtcf::Component {
    rtcf::Input<double> in{this, "in"};
    rtcf::Input<double> reference{this, "reference"};
    rtcf::Output<bool> out{this, "out"};

    rtcf::Parameter<Relation> relation{
        this,
        "relation",
        Relation::Above,
        rtcf::Choice("above", Relation::Above),
        rtcf::Choice("below", Relation::Below),
        rtcf::Choice("within", Relation::Within),
        rtcf::Doc("true if in is above, below or within the tolerance of the reference")};
    rtcf::Parameter<double> threshold{this, "threshold", 0.0,
                                      rtcf::Doc("reference until that input has a value")};
    rtcf::Parameter<double> tolerance{
        this, "tolerance", 0.0, rtcf::Min(0.0),
        rtcf::Doc("largest distance to the reference for the relation within")};

    void update() override {
        const bool referenced = reference.read() != rtcf::DataStatus::None;
        if (in.read() == rtcf::DataStatus::None) return;
        const double difference = in.value() - (referenced ? reference.value() : threshold);
        switch (relation.value()) {
            case Relation::Above:
                out.write(difference > 0.0);
                break;
            case Relation::Below:
                out.write(difference < 0.0);
                break;
            case Relation::Within:
                out.write(std::abs(difference) <= tolerance);
                break;
        }
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Comparator, "Comparator",
                     "Compares a value with a reference; false for NaN", Comparator)
