// A component whose values can fail to be copied, as without memory.
#include <new>
#include <rtcf/component.hpp>

#include "journal.hpp"

namespace rtcf_unit_test {

struct Fragile {
    Fragile() = default;
    Fragile(const Fragile& other) { *this = other; }
    Fragile& operator=(const Fragile& other) {
        if (rtcf_unit_test_journal != nullptr && rtcf_unit_test_journal()->copies_throw.load())
            throw std::bad_alloc();
        number = other.number;
        return *this;
    }
    ~Fragile() = default;
    double number = 0.0;
};

struct FragileConversion {
    static const char* name() { return "rtcf_unit_test/Fragile"; }
    static void toMessage(const Fragile& value, std_msgs::Float64& message) {
        message.data = value.number;
    }
    static void fromMessage(const std_msgs::Float64& message, Fragile& value) {
        value.number = message.data;
    }
};

}  // namespace rtcf_unit_test

template <>
struct rtcf::PortType<rtcf_unit_test::Fragile>
    : rtcf::MappedPortType<rtcf_unit_test::Fragile, std_msgs::Float64,
                           rtcf_unit_test::FragileConversion> {};

namespace {

class Touchy final : public rtcf::Component {
    rtcf::Input<rtcf_unit_test::Fragile> in{this, "in"};
    rtcf::Output<rtcf_unit_test::Fragile> out{this, "out"};
    rtcf::Parameter<double> gain{this, "gain", 1.0};

    void update() override {
        in.read();
        out.value().number += gain;
        out.publish();
    }
    void safe() noexcept override {
        out.value().number = 0.0;
        out.publish();
    }
};

// Commands 5, and 0 in safe(), beside a value whose copy may fail.
class Couple final : public rtcf::Component {
    rtcf::Output<double> command{this, "command"};
    rtcf::Output<rtcf_unit_test::Fragile> fragile{this, "fragile"};

    void update() override {
        command.write(5.0);
        fragile.publish();
    }
    void safe() noexcept override { command.write(0.0); }
};

}  // namespace

RTCF_COMPONENT(Couple, "Has a command, and a value whose copies may fail")
RTCF_COMPONENT(Touchy, "Has values whose copies may fail")
