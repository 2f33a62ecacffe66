#include <cmath>
#include <cstdint>

#include <rtcf/component.hpp>

#include "latch.hpp"

namespace rtcf_control {
namespace {

// Watches the counter of another program, and counts itself for it. A counter that is sent again
// without a change is no beat: its writer may repeat the last value after its source has failed.
class Heartbeat final : public rtcf::Component {
    rtcf::Input<std::uint32_t> beat{this, "beat"};
    rtcf::Input<bool> reset{this, "reset"};
    rtcf::Output<bool> stopped{this, "stopped"};
    rtcf::Output<std::int32_t> state{this, "state"};
    rtcf::Output<std::uint32_t> count{this, "count"};

    rtcf::Parameter<double> timeout{
        this,
        "timeout",
        0.1,
        rtcf::Min(0.0),
        rtcf::Max(1e6),
        rtcf::Unit("s"),
        rtcf::Doc("longest time between beats; 0 = each cycle needs one")};
    rtcf::Parameter<bool> latching{
        this, "latching", true,
        rtcf::Doc("a missed beat needs a reset; false: the next beat ends the stop")};
    rtcf::Parameter<double> interval{this,
                                     "interval",
                                     0.0,
                                     rtcf::Min(0.0),
                                     rtcf::Max(1e6),
                                     rtcf::Unit("s"),
                                     rtcf::Doc("time between steps of count; 0 = one each cycle")};

    rtcf::State<Latch> latch_{this, "latch", {}, rtcf::Live()};
    rtcf::State<std::int64_t> age_{
        this,        "since_beat", 0, rtcf::Unit("ns"), rtcf::Doc("time since the last beat"),
        rtcf::Live()};
    rtcf::State<std::uint32_t> last_{this, "last", 0, rtcf::Doc("number of the last beat"),
                                     rtcf::Live()};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the first beat has come"),
                             rtcf::Live()};
    rtcf::State<std::uint32_t> count_{this, "own_beats", 0, rtcf::Doc("own beats")};
    rtcf::State<std::int64_t> since_{this, "since_own_beat", 0, rtcf::Unit("ns"),
                                     rtcf::Doc("time since the last own beat")};

    bool start() override {
        latch_ = Latch{};
        age_ = 0;
        begun_ = false;
        since_ = 0;
        return true;
    }

    // The other program sees the end by the counter, which stands still.
    void safe() noexcept override { stopped.write(true); }

    void update() override {
        const rtcf::DataStatus status = beat.read();
        const bool has_value = status != rtcf::DataStatus::None;
        // A value from before the start is no beat.
        const bool beats =
            begun_ ? has_value && beat.value() != last_ : status == rtcf::DataStatus::New;
        if (has_value) last_ = beat.value();
        age_ = beats ? 0 : age_ + elapsed();
        begun_ = begun_ || beats;
        // Without a first beat, there is nothing to rely on: stopped, but not latched.
        const bool late = begun_ && age_ > std::llround(timeout * 1e9);
        const bool wanted = reset.read() != rtcf::DataStatus::None && reset.value();
        const bool was_stopped = latch_.value().stopped();
        latch_.value().update(late, beats, wanted);
        if (was_stopped && !latching && beats) latch_ = Latch{};
        stopped.write(latch_.value().stopped() || !begun_);
        state.write(begun_ ? latch_.value().state()
                           : static_cast<std::int32_t>(StopState::Waiting));
        countUp();
    }

    void countUp() {
        since_ += elapsed();
        const std::int64_t wanted = std::llround(interval * 1e9);
        if (since_ < wanted) return;
        // Steps keep their average rate, but never catch up by more than one.
        since_ = wanted > 0 ? since_ % wanted : 0;
        count_ += 1U;
        count.write(count_);
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::Heartbeat, "Heartbeat",
                     "Watches the counter of another program, latching; counts itself for it",
                     Heartbeat)
