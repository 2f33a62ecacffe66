/// @file
/// A component without hooks, for ports and parameters; setTime() sets its time. For tests of the
/// API alone.
#pragma once

#include "rtcf/component.hpp"

namespace rtcf::test {

class BareComponent final : public Component {
   public:
    BareComponent() {
        context.full_name = "/bare";
        context.name = "bare";
        context.clock = &loop_clock;
        context.period_ns = loop_clock.period_ns;
        attach(context);
    }
    void update() override {}

    LoopClock loop_clock;
    ComponentContext context;
};

}  // namespace rtcf::test
