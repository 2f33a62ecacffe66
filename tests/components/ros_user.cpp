// Uses ROS in its hooks through standard node handles, like any node.
#include <ros/param.h>
#include <std_msgs/Float64.h>
#include <rtcf/component.hpp>
#include <rtcf/ros.hpp>

#include <atomic>

namespace {

class RosUser final : public rtcf::Component {
    rtcf::Output<double> heard{this, "heard"};
    rtcf::Output<double> gain{this, "gain"};
    // The hook that calls the master: configure, start, or start ignoring the result; or
    // configure creates a handle without a call.
    rtcf::Parameter<std::string> in{this, "in", "configure",
                                    rtcf::Doc("configure, start, careless or handle")};

    bool configure() override {
        if (in.value() == "handle") rtcf::nodeHandle(this);
        return in.value() != "configure" || meet();
    }
    bool start() override {
        if (in.value() == "start" && !meet()) return false;
        // As in users' code: the result of getParam() is ignored.
        if (in.value() == "careless") ros::param::get("/something", gain_);
        return true;
    }
    void update() override {
        heard.write(heard_);
        gain.write(gain_);
    }
    void cleanup() override {
        subscriber_.shutdown();
        publisher_.shutdown();
    }

    bool meet() {
        ros::NodeHandle handle = rtcf::nodeHandle(this);
        ros::NodeHandle own = rtcf::privateNodeHandle(this);
        own.param("gain", gain_, 1.0);
        publisher_ = own.advertise<std_msgs::Float64>("said", 1, true);
        subscriber_ = handle.subscribe("ear", 1, &RosUser::hear, this);
        std_msgs::Float64 message;
        message.data = gain_;
        publisher_.publish(message);
        ROS_WARN("gain is %g", gain_);
        return true;
    }
    void hear(const std_msgs::Float64& message) { heard_ = message.data; }

    double gain_ = 0.0;
    std::atomic<double> heard_{0.0};
    ros::Publisher publisher_;
    ros::Subscriber subscriber_;
};

}  // namespace

RTCF_COMPONENT(RosUser, "Uses ROS in its hooks")
