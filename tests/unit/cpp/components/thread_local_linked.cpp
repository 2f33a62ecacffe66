#include <rtcf/component.hpp>

double countInThisThread();

namespace {

class ThreadLocalLinked final : public rtcf::Component {
    rtcf::Output<double> out{this, "out"};

    void update() override { out.write(countInThisThread()); }
};

}  // namespace

RTCF_COMPONENT(ThreadLocalLinked, "Keeps numbers by thread, elsewhere")
