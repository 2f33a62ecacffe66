// Built twice: as anyone would, and with the memory of its thread_local at hand from the start.
#include <rtcf/component.hpp>

namespace {

thread_local double of_this_thread[16];

class ThreadLocal final : public rtcf::Component {
    rtcf::Output<double> out{this, "out"};

    void update() override { out.write(++of_this_thread[iteration() % 16]); }
};

}  // namespace

RTCF_COMPONENT(ThreadLocal, "Keeps numbers by thread")
