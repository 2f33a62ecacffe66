// A component with an output like that of a controller, which a controller can replace.
#include <rtcf/component.hpp>

namespace {

class Effort final : public rtcf::Component {
    rtcf::Output<double> effort_{this, "effort"};
    rtcf::Parameter<double> value_{this, "effort", 0.0, rtcf::Doc("the value to write")};

    void update() override { effort_.write(value_); }
};

}  // namespace

RTCF_COMPONENT(Effort, "Writes an effort")
