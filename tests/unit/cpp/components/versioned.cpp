// Built twice, with different VERSIONs: the same type before and after a rebuild.
#include <array>
#include <rtcf/component.hpp>

namespace {

// Structs of the same names and sizes, of which one build swaps fields. Two name their fields.
struct Command {
#if VERSION == 2
    double time = 0.0;
    double force = 0.0;
#else
    double force = 0.0;
    double time = 0.0;
#endif
};

struct Target {
#if VERSION == 2
    double velocity = 0.0;
    double position = 0.0;
#else
    double position = 0.0;
    double velocity = 0.0;
#endif
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("position", position);
        visit("velocity", velocity);
    }
};

struct Limits {
    double low = 0.0;
    double high = 0.0;
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("low", low);
        visit("high", high);
    }
};

class Sender final : public rtcf::Component {
    rtcf::Output<Command> command{this, "command"};
    rtcf::Output<Target> target{this, "target"};
    rtcf::Output<std::array<Limits, 2>> limits{this, "limits"};
    void update() override {}
};

class Receiver final : public rtcf::Component {
    rtcf::Input<Command> command{this, "command"};
    rtcf::Input<Target> target{this, "target"};
    rtcf::Input<std::array<Limits, 2>> limits{this, "limits"};
    void update() override {}
};

class Versioned final : public rtcf::Component {
    rtcf::Output<std::int32_t> out{this, "out"};
    void update() override { out.write(VERSION); }
};

}  // namespace

RTCF_COMPONENT(Sender, "Writes structs")
RTCF_COMPONENT(Receiver, "Reads structs")
RTCF_COMPONENT(Versioned, "Writes its VERSION")
