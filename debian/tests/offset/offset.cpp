// A component with every kind of port, built outside the source tree.
#include <geometry_msgs/Vector3.h>
#include <std_msgs/String.h>

#include <rtcf/component.hpp>
#include <rtcf/eigen_type.hpp>

namespace {

class Offset final : public rtcf::Component {
    rtcf::Input<double> in{this, "in"};
    rtcf::Output<double> out{this, "out", "m"};
    rtcf::Output<Eigen::Vector3d> vector{this, "vector"};
    rtcf::Output<std_msgs::String> text{this, "text"};
    rtcf::Parameter<double> offset{this,           "offset", 1.0, rtcf::Min(-10.0), rtcf::Max(10.0),
                                   rtcf::Unit("m")};

    bool configure() override {
        text.value().data = "configured";
        text.publish();
        return true;
    }

    void update() override {
        in.read();
        out.write(in.value() + offset);
        vector.write(Eigen::Vector3d(in.value(), offset, 0.0));
    }
};

}  // namespace

RTCF_COMPONENT(Offset, "Adds a constant")
