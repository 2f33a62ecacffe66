// Components whose ports carry types of their own that travel as ROS messages.
#include <std_msgs/Int32.h>

#include <cstdlib>
#include <rtcf/component.hpp>

namespace rtcf_unit_test {

enum class Gear : std::uint8_t { None, Low, High };

// Ends the process for a value that no component has written: a table has no place for it.
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

}  // namespace rtcf_unit_test

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

}  // namespace

RTCF_COMPONENT(Gearbox, "Writes values of which not every one is a message")
