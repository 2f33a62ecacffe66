// A device that paces its loop, and a component that outputs the loop's times.
#include <time.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <rtcf/component.hpp>

#include "journal.hpp"

namespace {

std::int64_t now() {
    timespec time{};
    clock_gettime(CLOCK_MONOTONIC, &time);
    return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

// Ready once each time that the test opens the journal's gate.
class Device final : public rtcf::Source {
    rtcf::Output<std::int32_t> out{this, "out"};
    std::int32_t count_ = 0;

    bool wait(std::int64_t deadline_ns) noexcept override {
        do {
            if (rtcf_unit_test_journal()->gate_open.exchange(false)) return true;
            const timespec pause{0, 50'000};
            nanosleep(&pause, nullptr);
        } while (now() < deadline_ns);
        return false;
    }
    void update() override { out.write(++count_); }
};

// All times in periods of a loop at 1 kHz.
class Watch final : public rtcf::Component {
    rtcf::Input<std::int32_t> in{this, "in"};
    rtcf::Output<std::int32_t> updates{this, "updates"};
    rtcf::Output<double> nominal{this, "nominal"};
    rtcf::Output<double> since{this, "since"};
    rtcf::Output<double> age{this, "age"};
    rtcf::Output<double> cycle{this, "cycle"};
    std::int32_t count_ = 0;

    void update() override {
        in.read();
        updates.write(++count_);
        nominal.write(static_cast<double>(period()) / kMillisecond);
        since.write(static_cast<double>(elapsed()) / kMillisecond);
        age.write(static_cast<double>(in.age(this)) / kMillisecond);
        cycle.write(static_cast<double>(iteration()));
    }

    static constexpr double kMillisecond = 1e6;
};

// Checks that elapsed() is the progress of time(), and that safe() has a later time than updates.
class Stopwatch final : public rtcf::Component {
    rtcf::Output<std::int64_t> furthest_off{this, "furthest_off", "ns"};
    rtcf::Output<std::int64_t> last{this, "last", "ns"};
    std::int64_t before_ = -1;
    std::int64_t furthest_off_ = 0;

    bool start() override {
        before_ = -1;
        return true;
    }
    void update() override {
        if (before_ >= 0) {
            const std::int64_t off = std::abs(time() - before_ - elapsed());
            furthest_off_ = std::max(furthest_off_, off);
        }
        before_ = time();
        furthest_off.write(furthest_off_);
        last.write(elapsed());
    }
    void safe() noexcept override {
        rtcf_unit_test_journal()->note(fullName(), time() > before_ ? "safe later" : "safe before");
    }
};

// Takes 6 ms in takeOver().
class SlowSuccessor final : public rtcf::Component {
    void update() override {}
    void takeOver(const rtcf::Predecessor& /*previous*/) noexcept override {
        const std::int64_t until = now() + 6'000'000;
        while (now() < until) {
        }
    }
};

// Its updates wait until the journal's gate is open.
class Gated final : public rtcf::Component {
    void update() override {
        const timespec pause{0, 50'000};
        if (rtcf_unit_test_journal()->gate_open.load()) return;
        rtcf_unit_test_journal()->note(fullName(), "waits");
        while (!rtcf_unit_test_journal()->gate_open.load()) nanosleep(&pause, nullptr);
    }
};

// Writes a subnormal number, unless it is flushed to zero.
class Subnormal final : public rtcf::Component {
    rtcf::Output<double> out{this, "out"};
    void update() override {
        const volatile double smallest = 3e-308;
        out.write(smallest / 16.0);
    }
};

}  // namespace

RTCF_COMPONENT(Gated, "Has an update() that waits for the test")
RTCF_COMPONENT(SlowSuccessor, "Has a slow takeOver()")
RTCF_COMPONENT(Stopwatch, "Compares time() and elapsed()")
RTCF_COMPONENT(Subnormal, "Writes a subnormal number")
RTCF_COMPONENT(Device, "Paces the loop")
RTCF_COMPONENT(Watch, "Outputs the loop's times")
