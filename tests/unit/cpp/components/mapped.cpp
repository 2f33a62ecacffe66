// Components whose ports have their own types, which are sent as ROS messages.
#include <std_msgs/Float64MultiArray.h>
#include <std_msgs/Int32.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <rtcf/component.hpp>
#include <vector>

namespace rtcf_unit_test {

enum class Gear : std::uint8_t { None, Low, High };

// Ends the process for a value that no component has written: it is outside a table.
struct GearOnRos {
    static const char* name() { return "rtcf_unit_test/Gear"; }
    static void toMessage(const Gear& value, std_msgs::Int32& message) {
        if (value != Gear::Low && value != Gear::High) std::abort();
        message.data = value == Gear::Low ? 10 : 20;
    }
    static void fromMessage(const std_msgs::Int32& message, Gear& value) {
        value = message.data == 10 ? Gear::Low : Gear::High;
    }
};

// A type of fixed size, whose message has any number of elements.
struct Scan {
    std::uint32_t count = 0;
    std::array<double, 50> ranges{};
};
// A type that owns memory.
struct Trace {
    std::vector<double> points;
};

struct ScanOnRos {
    static const char* name() { return "rtcf_unit_test/Scan"; }
    static void toMessage(const Scan& value, std_msgs::Float64MultiArray& message) {
        message.data.assign(value.ranges.begin(), value.ranges.begin() + value.count);
    }
    static void fromMessage(const std_msgs::Float64MultiArray& message, Scan& value) {
        value.count = static_cast<std::uint32_t>(message.data.size());
        std::copy(message.data.begin(), message.data.end(), value.ranges.begin());
    }
};
struct TraceOnRos {
    static const char* name() { return "rtcf_unit_test/Trace"; }
    static void toMessage(const Trace& value, std_msgs::Float64MultiArray& message) {
        message.data = value.points;
    }
    static void fromMessage(const std_msgs::Float64MultiArray& message, Trace& value) {
        value.points = message.data;
    }
};

}  // namespace rtcf_unit_test

template <>
struct rtcf::PortType<rtcf_unit_test::Scan>
    : rtcf::MappedPortType<rtcf_unit_test::Scan, std_msgs::Float64MultiArray,
                           rtcf_unit_test::ScanOnRos> {};
template <>
struct rtcf::PortType<rtcf_unit_test::Trace>
    : rtcf::MappedPortType<rtcf_unit_test::Trace, std_msgs::Float64MultiArray,
                           rtcf_unit_test::TraceOnRos> {};
template <>
struct rtcf::PortType<rtcf_unit_test::Gear>
    : rtcf::MappedPortType<rtcf_unit_test::Gear, std_msgs::Int32, rtcf_unit_test::GearOnRos> {};

namespace {

class Gearbox final : public rtcf::Component {
    rtcf::Output<rtcf_unit_test::Gear> gear{this, "gear"};

    void update() override {
        gear.write(iteration() % 2 == 0 ? rtcf_unit_test::Gear::Low : rtcf_unit_test::Gear::High);
    }
};

// Writes as many ranges as there were cycles, up to 50, and outputs the number that it has read.
class Scanner final : public rtcf::Component {
    rtcf::Input<rtcf_unit_test::Scan> in{this, "in"};
    rtcf::Output<rtcf_unit_test::Scan> scan{this, "scan"};
    rtcf::Output<double> seen{this, "seen"};

    void update() override {
        if (in.read() == rtcf::DataStatus::New) seen.write(in.value().count);
        rtcf_unit_test::Scan& value = scan.value();
        value.count = static_cast<std::uint32_t>(iteration() % value.ranges.size());
        for (std::uint32_t i = 0; i < value.count; ++i) value.ranges[i] = i;
        scan.publish();
    }
};

class Tracer final : public rtcf::Component {
    rtcf::Output<rtcf_unit_test::Trace> trace{this, "trace"};

    bool configure() override {
        trace.reserve({std::vector<double>(50)});
        return true;
    }
    void update() override {
        trace.value().points.resize(iteration() % 50);
        trace.publish();
    }
};

}  // namespace

RTCF_COMPONENT(Scanner, "Writes values whose messages have arrays")
RTCF_COMPONENT(Tracer, "Writes values that own memory")
RTCF_COMPONENT(Gearbox, "Writes values that not all convert to a message")
