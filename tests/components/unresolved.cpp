// A component of a library that does not load: an undefined symbol.
#include <rtcf/component.hpp>

extern "C" void rtcf_test_symbol_that_nobody_has();

namespace {

class Unresolved final : public rtcf::Component {
    bool configure() override {
        rtcf_test_symbol_that_nobody_has();
        return true;
    }
    void update() override {}
};

}  // namespace

RTCF_COMPONENT(Unresolved, "Its library lacks a symbol")
