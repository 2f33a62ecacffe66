// OROCOS features used by components of RTCF 2021, besides ports of messages and RTCF's macros.
#include <std_msgs/Float64.h>

#include <array>
#include <rtt/Component.hpp>
#include <rtt/InputPort.hpp>
#include <rtt/Logger.hpp>
#include <rtt/OutputPort.hpp>
#include <rtt/TaskContext.hpp>
#include <rtt/base/PortInterface.hpp>
#include <rtt/os/TimeService.hpp>
#include <rtt/rt_string.hpp>
#include <string>
#include <vector>

// These include ros/ros.h and ros/console.h.
#include <rtcf/rt_logging_macros.hpp>
#include <rtcf/rtcf_extension.hpp>

namespace rtcf_unit_test {

struct Gains {
    int joint;
    double gain;
};
enum class Mode { Idle, Position, Force };
using Triple = std::array<float, 3>;

/// Writes values whose types are not messages.
class Sender : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Sender(const std::string& name) : TaskContext(name) {
        text_.setDataSample(std::string(100, ' '));
        numbers_.setDataSample(std::vector<double>(100));
        for (RTT::base::PortInterface* port : all()) addPort(*port);
        written_.reserve(100);
    }
    void updateHook() override {
        gains_.write({7, 0.5});
        mode_.write(Mode::Force);
        triple_.write({1.0F, 2.0F, 3.0F});
        text_.write(said_);
        written_.assign(getIteration() % 100, 0.25);
        numbers_.write(written_);
    }

   private:
    std::array<RTT::base::PortInterface*, 5> all() {
        return {&gains_, &mode_, &triple_, &text_, &numbers_};
    }
    RTT::OutputPort<Gains> gains_{"gains"};
    RTT::OutputPort<Mode> mode_{"mode"};
    RTT::OutputPort<Triple> triple_{"triple"};
    RTT::OutputPort<std::string> text_{"text"};
    RTT::OutputPort<std::vector<double>> numbers_{"numbers"};
    const std::string said_ = "a text that is longer than what a string holds in itself";
    std::vector<double> written_;
};

/// Reads them, and logs the values.
class Receiver : public RTT::TaskContext {
   public:
    explicit Receiver(const std::string& name) : TaskContext(name) {
        addPort("gains", gains_);
        addPort("mode", mode_);
        addPort("triple", triple_);
        addPort("text", text_);
        addPort("numbers", numbers_);
        said_.reserve(100);
        read_.reserve(100);
    }
    void updateHook() override {
        Gains gains{};
        Mode mode{};
        Triple triple{};
        if (gains_.read(gains) != RTT::NewData || mode_.read(mode) != RTT::NewData) return;
        triple_.read(triple);
        text_.read(said_);
        numbers_.read(read_);
        RTT::log(RTT::Info) << gains.joint << ' ' << gains.gain << ' ' << static_cast<int>(mode)
                            << ' ' << triple[2] << ' ' << said_ << ' ' << read_.size()
                            << RTT::endlog();
    }

   private:
    RTT::InputPort<Gains> gains_;
    RTT::InputPort<Mode> mode_;
    RTT::InputPort<Triple> triple_;
    RTT::InputPort<std::string> text_;
    RTT::InputPort<std::vector<double>> numbers_;
    std::string said_;
    std::vector<double> read_;
};

/// Logs in every possible way, including in its constructor.
class Logger : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Logger(const std::string& name) : TaskContext(name) {
        RTT::Logger::In in("Logger");
        RTT::log(RTT::Warning) << "constructed by " << 1
                               << std::endl;  // NOLINT(performance-avoid-endl): as in users' code
        RT_INFO("constructed by 2");
        rtLogError("constructed by 3");
    }
    bool configureHook() override {
        RTT::Logger::log(RTT::Logger::Error) << "configured" << RTT::Logger::endl;
        RTT::log(RTT::Debug) << "is not shown" << RTT::endlog();
        return true;
    }
    void updateHook() override {
        const RTT::os::TimeService* const clock = RTT::os::TimeService::Instance();
        const RTT::os::TimeService::ticks begin = clock->getTicks();
        RTT::log() << "updated" << RTT::endlog();
        if (clock->secondsSince(begin) < 0.0) rtLogFatal("never");
        rtLogInfo("and again");
    }
};

/// Fails in its constructor after logging.
class Unlucky : public RTT::TaskContext {
   public:
    explicit Unlucky(const std::string& name) : TaskContext(name) {
        RT_WARN("about to fail");
        throw std::runtime_error("no luck");
    }
};

/// In the error state in iterations 2 and 3.
class Erring : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Erring(const std::string& name) : TaskContext(name) {}
    void updateHook() override {
        RT_INFO_STREAM("update " << getIteration());
        if (getIteration() == 1) error();
    }
    void errorHook() override {
        RT_INFO_STREAM("error " << getIteration() << (inRunTimeError() ? "" : " ?"));
        if (getIteration() == 3) recover();
    }
};

/// Logs its ports, uses a port's callback, and stops listening to it.
class Listener : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Listener(const std::string& name) : TaskContext(name) {
        ports()->addEventPort("in", in_, [this](RTT::base::PortInterface* port) {
            RT_INFO_STREAM("called by " << port->getName());
        });
        ports()->addPort(other_);
    }
    bool configureHook() override {
        std::string names;
        for (const RTT::base::PortInterface* port : ports()->getPorts())
            names += port->getName() + " ";
        RT_INFO(names + (getPort("other") == &other_ ? "yes" : "no") +
                (ports()->getPort("none") == nullptr ? "yes" : "no"));
        return true;
    }
    void updateHook() override {
        std_msgs::Float64 sample;
        if (getIteration() == 2) in_.clear();
        if (getIteration() == 5) in_.disconnect();
        RT_INFO_STREAM(getIteration() << ": " << in_.read(sample));
        if (getIteration() != 4 && getIteration() != 6) return;
        sample.data = -1.0;
        in_.getDataSample(sample);
        RT_INFO_STREAM("sample " << sample.data);
    }

   private:
    RTT::InputPort<std_msgs::Float64> in_;
    RTT::OutputPort<std_msgs::Float64> other_{"other"};
};

/// Uses OROCOS properties and operations, and logs by streams.
class Property21 : public RTT::TaskContext, public RtcfExtension {
   public:
    explicit Property21(const std::string& name) : TaskContext(name) {
        addProperty("gain", gain_).doc("of the loop");
        provides()->addProperty("count", count_);
        this->provides("tuning")->addProperty("label", label_);
        addProperty("late", late_);
        addOperation("reset", &Property21::reset, this, RTT::OwnThread).doc("none").arg("a", "b");
        addPort("gain_seen", out_);
    }
    bool configureHook() override {
        rtLogStream(ros::console::levels::Info)
            << "configured with " << gain_ << ' ' << count_ << ' ' << label_
            << std::endl;  // NOLINT(performance-avoid-endl): as in users' code
        rtLogStream(ros::console::levels::Debug) << "not shown";
        active("configureHook");
        return true;
    }
    void updateHook() override {
        out_.write(gain_ + late_);
        if (getIteration() == 0) active("updateHook");
        if (getIteration() == 1) gain_ = 7.0;  // its own value, until the parameter changes
    }
    void stopHook() override {
        rtLogStream(ros::console::levels::Warn) << "stopped with " << label_;
        active("stopHook");
    }

   private:
    void reset() { gain_ = 0.0; }
    void active(const char* hook) {
        const bool active = RT_ACTIVE;
        RT_INFO_STREAM(hook << (active ? ": active" : ": not active"));
    }

    double gain_ = 0.5;
    int count_ = 3;
    std::string label_ = "plain";
    double late_ = 0.0;
    RTT::OutputPort<double> out_{"gain_seen"};
};

/// Adds a property after parameters can be set.
class LateProperty : public RTT::TaskContext {
   public:
    explicit LateProperty(const std::string& name) : TaskContext(name) {}
    bool configureHook() override {
        addProperty("late", late_);
        return true;
    }

   private:
    double late_ = 0.0;
};

}  // namespace rtcf_unit_test

ORO_CREATE_COMPONENT_LIBRARY()
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Sender)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Receiver)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Logger)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Unlucky)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Erring)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Listener)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::Property21)
ORO_LIST_COMPONENT_TYPE(rtcf_unit_test::LateProperty)
ORO_CREATE_COMPONENT_TYPE()
