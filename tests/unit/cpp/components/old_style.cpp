// Components in the style of RTCF 2021, for tests of source compatibility.
#include <std_msgs/Float64.h>
#include <std_msgs/String.h>

#include <rtcf/macros.hpp>
#include <rtcf/rtcf_extension.hpp>
OROCOS_HEADERS_BEGIN
#include <rtt/Component.hpp>
#include <rtt/Port.hpp>
#include <rtt/RTT.hpp>
OROCOS_HEADERS_END

#include <iomanip>
#include <limits>
#include <sstream>
#include <string>

namespace rtcf_unit_test {

/// Writes its iteration in every third cycle.
class Third : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Third(const std::string& name) : TaskContext(name) { ports()->addPort(out_); }
    void updateHook() override {
        if (getIteration() % 3 != 0) return;
        number_.data = static_cast<double>(getIteration());
        status_ = out_.write(number_);
        heard_number_.data = out_.connected() ? 1.0 : 0.0;
        heard_.write(heard_number_);
    }
    bool configureHook() override {
        ports()->addPort("heard", heard_).doc("whether `out` has a peer");
        return true;
    }

   private:
    RTT::OutputPort<std_msgs::Float64> out_{"out"};
    RTT::OutputPort<std_msgs::Float64> heard_;
    std_msgs::Float64 number_;
    std_msgs::Float64 heard_number_;
    RTT::WriteStatus status_ = RTT::NotConnected;
};

/// Outputs the results of its reads.
class Reader : public RTT::TaskContext {
   public:
    explicit Reader(const std::string& name) : TaskContext(name), in_("in") {
        addPort(in_).doc("what is read");
    }
    bool configureHook() override {
        addPort("flow", flow_);
        addPort("copied", copied_);
        addPort("copied_old", copied_old_);
        addPort("connected", connected_);
        return true;
    }
    void updateHook() override {
        std_msgs::Float64 sample;
        sample.data = -1.0;
        write(flow_, in_.read(sample, false));
        write(copied_, sample.data);
        // Read already: old data, if there is a value.
        (void)in_.read(sample);
        write(copied_old_, sample.data);
        write(connected_, in_.connected() ? 1.0 : 0.0);
    }

   private:
    using Output = RTT::OutputPort<std_msgs::Float64>;
    static void write(Output& output, double number) {
        std_msgs::Float64 message;
        message.data = number;
        output.write(message);
    }

    RTT::InputPort<std_msgs::Float64> in_;
    Output flow_;
    Output copied_;
    Output copied_old_;
    Output connected_;
};

/// Logs its own properties in each hook.
class Teller : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Teller(const std::string& name) : TaskContext(name), constructed_as_(name) {}
    bool configureHook() override {
        NON_RT_INFO_STREAM("constructed as " << constructed_as_ << ", is " << getName());
        return tell("configure");
    }
    bool startHook() override { return tell("start"); }
    void updateHook() override {
        tell("update");
        RT_INFO_STREAM("period " << getPeriod() << " s, " << getFrequency() << " Hz, iteration "
                                 << getIteration() << ", time " << getTime());
    }
    void stopHook() override { tell("stop"); }
    void cleanupHook() override { tell("cleanup"); }

   private:
    bool tell(const char* hook) {
        RT_INFO_STREAM(hook << ": " << (isRunning() ? "running" : "not running") << ", state "
                            << getTaskState() << ", target " << getTargetState());
        return true;
    }
    std::string constructed_as_;
};

/// Logs in all forms.
class Writer : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Writer(const std::string& name) : TaskContext(name), long_(5000, 'x') {}
    void updateHook() override {
        RT_DEBUG("is not shown");
        RT_INFO("100 % as it is: {} %d");
        RT_WARN(warning_);
        RT_ERROR_STREAM("a number " << std::fixed << std::setprecision(3) << 1.0 / 3.0 << ' '
                                    << std::hex << 255 << std::dec << ' ' << true);
        NON_RT_INFO("%s has %d joints of %.2f m", "arm", 7, 0.5);
        NON_RT_FATAL("100 %%");
        RT_INFO_STREAM(long_ << 1);
        NON_RT_INFO("%s", long_.c_str());
        if (std::numeric_limits<double>::has_infinity)
            RT_INFO("no braces are needed");
        else
            RT_INFO("never");
    }

   private:
    const std::string warning_ = "a std::string";
    const std::string long_;
};

/// Adds a port too late.
class TooLate : public RTT::TaskContext {
   public:
    explicit TooLate(const std::string& name) : TaskContext(name) {}
    bool startHook() override {
        addPort(late_);
        return true;
    }

   private:
    RTT::InputPort<std_msgs::Float64> late_{"late"};
};

/// Adds one port twice, and replaces others by ports of the same names.
class Twice : public RTT::TaskContext {
   public:
    explicit Twice(const std::string& name) : TaskContext(name) {
        addPort(in_);
        addPort(replaced_out_);
        addPort(out_);
        addPort("connected", connected_);
    }
    bool configureHook() override {
        addPort("in", in_);
        addPort(in_);
        addEventPort(replacing_in_, [this](RTT::base::PortInterface*) {
            std_msgs::Float64 message;
            replacing_in_.read(message);
            out_.write(message);
        });
        return ports()->getPorts().size() == 3 && getPort("in") == &replacing_in_;
    }
    void updateHook() override {
        std_msgs::Float64 connected;
        connected.data = (in_.connected() ? 1.0 : 0.0) + (replacing_in_.connected() ? 10.0 : 0.0);
        connected_.write(connected);
        replaced_out_.write(connected);
    }

   private:
    RTT::InputPort<std_msgs::Float64> in_{"in"};
    RTT::InputPort<std_msgs::Float64> replacing_in_{"in"};
    RTT::OutputPort<std_msgs::Float64> replaced_out_{"out"};
    RTT::OutputPort<std_msgs::Float64> out_{"out"};
    RTT::OutputPort<std_msgs::Float64> connected_;
};

/// Adds two ports with one name, which cannot replace each other.
class Retyped : public RTT::TaskContext {
   public:
    explicit Retyped(const std::string& name) : TaskContext(name) { addPort(in_); }
    bool configureHook() override {
        addPort(out_);
        return true;
    }

   private:
    RTT::InputPort<std_msgs::Float64> in_{"port"};
    RTT::OutputPort<std_msgs::Float64> out_{"port"};
};

/// Adds one port by two names.
class Renamed : public RTT::TaskContext {
   public:
    explicit Renamed(const std::string& name) : TaskContext(name) { addPort("one", in_); }
    bool configureHook() override {
        addPort("other", in_);
        return true;
    }

   private:
    RTT::InputPort<std_msgs::Float64> in_;
};

/// Uses the extension before it exists.
class TooEarly : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit TooEarly(const std::string& name) : TaskContext(name) { (void)getNodeHandle(); }
};

/// Needs ROS.
class NeedsRos : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit NeedsRos(const std::string& name) : TaskContext(name) {}
    bool configureHook() override { return getNodeHandle().hasParam("anything"); }
};

/// A message of growing size, with reserved memory for the largest.
class Grower : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Grower(const std::string& name) : TaskContext(name) {
        largest_.data.assign(200, 'y');
        out_.setDataSample(largest_);
        addPort(out_);
    }
    void updateHook() override {
        largest_.data.resize(getIteration() % 200);
        out_.write(largest_);
    }

   private:
    RTT::OutputPort<std_msgs::String> out_{"out"};
    std_msgs::String largest_;
};

}  // namespace rtcf_unit_test

ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Third)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Reader)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Teller)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Writer)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::TooLate)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Twice)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Retyped)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Renamed)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::TooEarly)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::NeedsRos)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Grower)
ORO_CREATE_COMPONENT_LIBRARY();
