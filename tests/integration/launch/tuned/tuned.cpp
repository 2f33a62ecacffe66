// Shows the values of its .cfg file, as RTCF 2021's examples use them.
#include <std_msgs/Float64.h>
#include <tuned/TuningConfig.h>

#include <rtcf/macros.hpp>
OROCOS_HEADERS_BEGIN
#include <rtt/Component.hpp>
#include <rtt/Port.hpp>
#include <rtt/RTT.hpp>
OROCOS_HEADERS_END

#include <rtcf/rt_dynamic_reconfigure.hpp>
#include <rtcf/rtcf_extension.hpp>

class Tuned : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Tuned(std::string const& name)
        : TaskContext(name), value_("value"), changes_("changes") {}

    bool configureHook() override {
        ports()->addPort(value_);
        ports()->addPort(changes_);
        config_.configure(getPrivateNodeHandle());
        return true;
    }
    void updateHook() override {
        if (config_.isNewDataAvailable()) ++count_.data;
        config_.getValue(tuning_);
        message_.data = tuning_.enabled ? tuning_.gain * tuning_.steps : -1.0;
        value_.write(message_);
        changes_.write(count_);
    }

   private:
    struct Tuning {
        using ConfigType = tuned::TuningConfig;
        Tuning(const ConfigType& config)
            : gain(config.gain), steps(config.steps), enabled(config.enabled) {}
        double gain;
        int steps;
        bool enabled;
    };

    RTDynamicReconfigure<Tuning> config_;
    Tuning tuning_{tuned::TuningConfig()};
    RTT::OutputPort<std_msgs::Float64> value_;
    RTT::OutputPort<std_msgs::Float64> changes_;
    std_msgs::Float64 message_;
    std_msgs::Float64 count_;
};

ORO_CREATE_COMPONENT(Tuned)
