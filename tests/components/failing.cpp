// Components whose hooks fail in every possible way.
#include <stdexcept>

#include <rtcf/component.hpp>

namespace {

class Idle : public rtcf::Component {
    void update() override {}
};

class FailingConfigure final : public Idle {
    bool configure() override {
        return fail("{} does not answer: is it plugged in?", "/dev/gripper");
    }
};

class SilentConfigure final : public Idle {
    bool configure() override { return false; }
};

class ThrowingConfigure final : public Idle {
    bool configure() override { throw std::runtime_error("the calibration is from yesterday"); }
};

class OddlyThrowingConfigure final : public Idle {
    bool configure() override { throw 42; }
};

class FailingStart final : public Idle {
    bool start() override { return fail("the emergency stop is pressed"); }
};

class ThrowingConstructor final : public Idle {
   public:
    ThrowingConstructor() { throw std::logic_error("no constructor should do this"); }
};

}  // namespace

RTCF_COMPONENT(FailingConfigure, "configure() fails with a reason")
RTCF_COMPONENT(SilentConfigure, "configure() fails without a reason")
RTCF_COMPONENT(ThrowingConfigure, "configure() throws")
RTCF_COMPONENT(OddlyThrowingConfigure, "configure() throws something other than a std::exception")
RTCF_COMPONENT(FailingStart, "start() fails")
RTCF_COMPONENT(ThrowingConstructor, "the constructor throws")
