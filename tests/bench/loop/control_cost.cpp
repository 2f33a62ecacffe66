// Measures update() of components of rtcf_control, alternating with the counterparts of LinuxCNC
// HAL, on the same inputs, which are new in each cycle. Compares the outputs first where both have
// the same law. Prints JSON.
// Usage: control_cost FOLDER_OF_HAL_MODULES
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sensor_msgs/JointState.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal_module.hpp"
#include "median.hpp"
#include "rtcf/test.hpp"

namespace {

using rtcf::bench::HalModule;
using rtcf::bench::median;
using rtcf::test::Bench;

constexpr int kRounds = 201;
constexpr int kUpdates = 1000;  // per round
constexpr int kCompared = 5000;
constexpr long kPeriodNs = 1'000'000;
constexpr double kTolerance = 1e-6;  // of values of size 1

// The inputs of both in cycle i.
double wave(int i) { return std::sin(0.011 * i) + 0.1 * std::sin(1.7 * i); }
double slowWave(int i) { return 0.8 * std::sin(0.011 * i - 0.2); }
double step(int i) { return (i / 500) % 2 == 0 ? 1.0 : -1.0; }

// A component of rtcf alone. update() includes the check of outputs that are declared Finite.
class Component {
   public:
    Component(const std::string& type, const Bench::Parameters& parameters)
        : bench_(type, parameters, kPeriodNs), component_(bench_.component()) {
        bench_.cycle();  // starts it
    }

    Bench& bench() { return bench_; }

    // The value of an input, for writing in each cycle.
    std::function<void(double)> input(const std::string& name) {
        for (rtcf::InputPort* input : accessTo(component_).inputs()) {
            if (input->name() != name) continue;
            slots_.push_back(input->type().make_slot(nullptr));
            input->connect(slots_.back().get(), false);
            auto* const slot = static_cast<rtcf::Slot<double>*>(slots_.back().get());
            return [slot](double value) {
                slot->value = value;
                ++slot->stamp;
            };
        }
        throw std::runtime_error("no input " + name);
    }
    void update() {
        accessTo(component_).setTime(component_.time() + 1);
        component_.update();
        for (rtcf::OutputPort* output : accessTo(component_).stagedOutputs()) output->commit();
    }

   private:
    Bench bench_;
    rtcf::Component& component_;
    std::vector<std::shared_ptr<rtcf::SlotHeader>> slots_;
};

struct Contest {
    std::string name;
    std::string reference;
    std::function<void(int)> write;  // the inputs of cycle i, of both
    std::function<void()> ours;
    std::function<void()> theirs;
    std::function<double()> difference;  // of the outputs; empty: other laws
    int settling = 0;                    // cycles without a comparison
};

// ns per update
double timed(const Contest& contest, const std::function<void()>& update) {
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < kUpdates; ++i) contest.write(i);
    const auto middle = std::chrono::steady_clock::now();
    for (int i = 0; i < kUpdates; ++i) {
        contest.write(i);
        update();
    }
    const auto end = std::chrono::steady_clock::now();
    const std::chrono::duration<double, std::nano> all = end - middle;
    const std::chrono::duration<double, std::nano> writes = middle - begin;
    return (all - writes).count() / kUpdates;
}

std::string row(const Contest& contest) {
    double largest = 0.0;
    for (int i = 0; i < kCompared; ++i) {
        contest.write(i);
        contest.ours();
        contest.theirs();
        if (!contest.difference || i < contest.settling) continue;
        largest = std::max(largest, std::abs(contest.difference()));
        if (!(largest <= kTolerance))
            throw std::runtime_error(
                fmt::format("{}: cycle {}: the outputs differ by {}", contest.name, i, largest));
    }
    std::vector<double> ours;
    std::vector<double> theirs;
    for (int round = 0; round < kRounds; ++round) {
        ours.push_back(timed(contest, contest.ours));
        theirs.push_back(timed(contest, contest.theirs));
    }
    return fmt::format(
        R"({{"name": "{}", "reference": "{}", "ns": {:.2f}, "reference_ns": {:.2f}, "compared": {}}})",
        contest.name, contest.reference, median(ours), median(theirs),
        contest.difference ? "true" : "false");
}

// Proportional and integral gain; the derivative of both on the error.
std::string pid(const std::string& modules) {
    Component ours("Pid", {{"kp", 2.0},
                           {"ki", 5.0},
                           {"kd", 0.01},
                           {"derivative_weight", 1.0},
                           {"lower", -20.0},
                           {"upper", 20.0}});
    const HalModule theirs(modules + "/pid.so");
    theirs.number("pid.0.Pgain") = 2.0;
    theirs.number("pid.0.Igain") = 5.0;
    theirs.number("pid.0.Dgain") = 0.01;
    theirs.number("pid.0.maxoutput") = 20.0;
    theirs.bit("pid.0.enable") = true;
    const auto setpoint = ours.input("setpoint");
    const auto measured = ours.input("measured");
    volatile double& command = theirs.number("pid.0.command");
    volatile double& feedback = theirs.number("pid.0.feedback");
    return row({"Pid",
                "pid",
                [&](int i) {
                    setpoint(wave(i));
                    measured(slowWave(i));
                    command = wave(i);
                    feedback = slowWave(i);
                },
                [&] { ours.update(); },
                [&] { theirs.update(kPeriodNs); },
                {}});
}

std::string biquad(const std::string& modules) {
    Component ours("Biquads", {{"sections", std::string("lowpass 40 0.707")}, {"settled", false}});
    const HalModule theirs(modules + "/biquad.so");
    theirs.number("biquad.0.f0") = 40.0;
    theirs.number("biquad.0.Q") = 0.707;
    theirs.whole("biquad.0.type") = 1;
    theirs.bit("biquad.0.enable") = true;
    const auto in = ours.input("in");
    volatile double& their_in = theirs.number("biquad.0.in");
    volatile double& their_out = theirs.number("biquad.0.out");
    return row({"Biquads, one low-pass", "biquad",
                [&](int i) {
                    in(wave(i));
                    their_in = wave(i);
                },
                [&] { ours.update(); }, [&] { theirs.update(kPeriodNs); },
                [&] { return *ours.bench().read<double>("out") - their_out; }, 1000});
}

// A target that changes every 500 cycles.
std::string trajectory(const std::string& modules) {
    Component ours("TrajectoryGenerator", {{"velocity", std::string("10")},
                                           {"acceleration", std::string("100")},
                                           {"jerk", std::string("10000")},
                                           {"initial", std::string("0")}});
    const HalModule theirs(modules + "/limit3.so");
    theirs.number("limit3.0.min") = -1e20;
    theirs.number("limit3.0.max") = 1e20;
    theirs.number("limit3.0.maxv") = 10.0;
    theirs.number("limit3.0.maxa") = 100.0;
    theirs.bit("limit3.0.enable") = true;
    theirs.whole("limit3.0.smooth-steps") = 2;
    volatile double& their_in = theirs.number("limit3.0.in");
    sensor_msgs::JointState target;
    target.position = {0.0};
    return row({"TrajectoryGenerator, one joint",
                "limit3",
                [&](int i) {
                    their_in = step(i);
                    if (i % 500 != 0) return;
                    target.position[0] = step(i);
                    ours.bench().write("target", target);
                },
                [&] { ours.update(); },
                [&] { theirs.update(kPeriodNs); },
                {}});
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc != 2) {
        std::fputs("usage: control_cost FOLDER_OF_HAL_MODULES\n", stderr);
        return 2;
    }
    const std::vector<std::string> rows{pid(argv[1]), biquad(argv[1]), trajectory(argv[1])};
    fmt::print(R"({{"rounds": {}, "updates": {}, "compared": {}, "tolerance": {}, "rows": [{}]}})"
               "\n",
               kRounds, kUpdates, kCompared, kTolerance, fmt::join(rows, ", "));
    return 0;
} catch (const std::exception& error) {
    fmt::print(stderr, "control_cost: {}\n", error.what());
    return 1;
}
