/// @file
/// A component without hooks, for ports and parameters; setTime() sets its time. For tests of the
/// API alone.
#pragma once

#include <stdexcept>

#include "rtcf/component.hpp"

namespace rtcf::test {

class BareComponent final : public Component {
   public:
    BareComponent() {
        context.full_name = "/bare";
        context.name = "bare";
        context.clock = &loop_clock;
        context.period_ns = loop_clock.period_ns;
        accessTo(*this).attach(context);
    }
    void update() override {}

    LoopClock loop_clock;
    ComponentContext context;
};

/// The executor's side of an output.
inline OutputPort& portOf(const Component& owner, const OutputBase& output) {
    for (OutputPort* port : accessTo(owner).outputs())
        if (&port->output() == &output) return *port;
    throw std::out_of_range(output.name());
}

}  // namespace rtcf::test
