// Built twice: with dynamic TLS, as usual, and with static TLS.
#include <rtcf/component.hpp>

namespace {

thread_local double of_this_thread[16];

class ThreadLocal final : public rtcf::Component {
    rtcf::Output<double> out{this, "out"};

    void update() override { out.write(++of_this_thread[iteration() % 16]); }
};

}  // namespace

RTCF_COMPONENT(ThreadLocal, "Has thread_local numbers")
