// Measures update() of components of the same name in two libraries, alternating, on the same
// inputs, which are new in each cycle. Compares the outputs of both first. Prints JSON.
// Usage: update_cost LIBRARY REFERENCE TYPE...
#include <dlfcn.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <map>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "median.hpp"
#include "rtcf/component.hpp"

namespace {

using rtcf::bench::median;

constexpr int kRounds = 201;
constexpr int kUpdates = 1000;       // per round
constexpr int kCompared = 5000;      // updates
constexpr double kTolerance = 1e-6;  // after thousands of updates

// An input signal: a slow wave with noise, or steps if it is written every few cycles.
struct Signal {
    double mean = 0.0;
    double amplitude = 1.0;
    double noise = 0.1;
    int every = 1;
};

Signal signalOf(const std::string& type, const std::string& input) {
    static const std::map<std::string, Signal> signals{
        {"DisturbanceObserver.velocity", {0.0, 3.0, 0.2}},
        {"GravityPd.position", {0.4, 0.6, 0.01}},
        {"GravityPd.setpoint", {0.4, 0.6, 0.0}},
        {"Interpolator.goal", {0.0, 1.0, 0.5, 1}},
        {"Kalman.gps", {0.0, 0.2, 0.05}},
        {"Kalman.odometry", {1.0, 0.3, 0.05}},
        {"Kalman.gyro", {0.1, 0.3, 0.01}},
        {"Lookup.current", {0.0, 8.0, 1.0}},
        {"Lookup.speed", {0.0, 250.0, 20.0}},
        {"Lookup.temperature", {40.0, 30.0, 5.0}},
        {"Lqr.state", {0.0, 0.2, 0.01}},
        {"Madgwick.acceleration", {5.0, 4.0, 0.3}},
        {"Madgwick.gyro", {0.0, 1.0, 0.05}},
        {"RingBuffer.u", {1.0, 2.0, 0.5}},
    };
    const auto found = signals.find(type + "." + input);
    return found != signals.end() ? found->second : Signal{};
}

// A component alone, whose inputs are written before each update.
class Contender {
   public:
    Contender(const char* library, const std::string& type) : name_(library + (": " + type)) {
        clock_.period_ns = 1'000'000;
        clock_.elapsed_ns = 1'000'000;
        context_.clock = &clock_;
        context_.period_ns = 1'000'000;
        component_.reset(recordOf(library, type).create(type.c_str(), &context_));
        accessTo(*component_).attach(context_);
        if (!component_->prepare(rtcf::Values{}) || !component_->configure()) fail();
        for (rtcf::DerivedBase* derived : accessTo(*component_).derived())
            if (derived->staged()) derived->commit();
        // By name: the two may declare their ports in different orders.
        std::vector<rtcf::InputPort*> inputs = accessTo(*component_).inputs();
        std::sort(inputs.begin(), inputs.end(),
                  [](const auto* a, const auto* b) { return a->name() < b->name(); });
        std::mt19937 draw(1);
        for (rtcf::InputPort* input : inputs) feed(*input, signalOf(type, input->name()), draw);
        outputs_ = accessTo(*component_).outputs();
        std::sort(outputs_.begin(), outputs_.end(),
                  [](const auto* a, const auto* b) { return a->name() < b->name(); });
        if (!component_->start()) fail();
    }

    // @return ns of writing the inputs of one update, and of writing plus the update
    std::pair<double, double> round() {
        const auto begin = std::chrono::steady_clock::now();
        for (int i = 0; i < kUpdates; ++i) write();
        const auto middle = std::chrono::steady_clock::now();
        for (int i = 0; i < kUpdates; ++i) {
            write();
            component_->update();
        }
        const auto end = std::chrono::steady_clock::now();
        const std::chrono::duration<double, std::nano> writes = middle - begin;
        const std::chrono::duration<double, std::nano> all = end - middle;
        return {writes.count() / kUpdates, all.count() / kUpdates};
    }

    void step() {
        write();
        component_->update();
    }

    // @throws std::runtime_error if the outputs of two contenders differ beyond rounding
    void compare(const Contender& other, int cycle) const {
        if (outputs_.size() != other.outputs_.size())
            throw std::runtime_error(name_ + ": other outputs than the reference");
        for (std::size_t i = 0; i < outputs_.size(); ++i)
            compare(*outputs_[i], *other.outputs_[i], cycle);
    }

   private:
    struct Feed {
        rtcf::SlotHeader* slot;
        char* place;
        std::size_t size;
        std::size_t every;
        std::vector<double> values;
    };

    [[noreturn]] void fail() const {
        throw std::runtime_error(name_ + ": " + accessTo(*component_).failure());
    }

    template <typename Header>
    static auto valueOf(Header& slot, const rtcf::TypeInfo& info) {
        using Byte = std::conditional_t<std::is_const_v<Header>, const char, char>;
        const std::size_t header = sizeof(rtcf::SlotHeader);
        return reinterpret_cast<Byte*>(&slot) +
               (header + info.alignment - 1) / info.alignment * info.alignment;
    }

    // For inputs of doubles only.
    void feed(rtcf::InputPort& input, const Signal& signal, std::mt19937& draw) {
        const rtcf::TypeInfo& info = input.type();
        slots_.push_back(info.make_slot(nullptr));
        input.connect(slots_.back().get(), false);
        std::normal_distribution<double> noise;
        std::uniform_real_distribution<double> any(0.0, 2.0 * M_PI);
        const std::size_t elements = info.size / sizeof(double);
        std::vector<double> phases(elements);
        std::generate(phases.begin(), phases.end(), [&] { return any(draw); });
        Feed found{
            slots_.back().get(), nullptr, info.size, static_cast<std::size_t>(signal.every), {}};
        found.place = valueOf(*found.slot, info);
        for (int i = 0; i < kUpdates; ++i) {
            for (std::size_t k = 0; k < elements; ++k) {
                // Whole waves per round, since it restarts at its end.
                const double turns = static_cast<double>(k % 3 + 1) * i / kUpdates;
                const double wave = std::sin(2.0 * M_PI * turns + phases[k]);
                found.values.push_back(signal.mean + signal.amplitude * wave +
                                       signal.noise * noise(draw));
            }
        }
        feeds_.push_back(std::move(found));
    }

    void write() {
        const std::size_t at = written_++ % kUpdates;
        accessTo(*component_).setTime(component_->time() + 1);
        for (Feed& each : feeds_) {
            if (each.every != 1 && at % each.every != 0) continue;
            const std::size_t doubles = each.size / sizeof(double);
            std::memcpy(each.place, &each.values[at * doubles], each.size);
            ++each.slot->stamp;
        }
    }

    void compare(const rtcf::OutputPort& ours, const rtcf::OutputPort& theirs, int cycle) const {
        const rtcf::TypeInfo& info = ours.type();
        const std::string_view type = info.name;
        if (ours.name() != theirs.name() || type != theirs.type().name)
            throw std::runtime_error(fmt::format("{}: {} ({}) is {} ({}) in the reference", name_,
                                                 ours.name(), type, theirs.name(),
                                                 theirs.type().name));
        const rtcf::SlotHeader& mine = *ours.written();
        const rtcf::SlotHeader& other = *theirs.written();
        if (mine.stamp != other.stamp)
            throw std::runtime_error(
                fmt::format("{}: cycle {}: {} was written {} times, {} times "
                            "in the reference",
                            name_, cycle, ours.name(), mine.stamp, other.stamp));
        const bool is_whole = type.find("int") != std::string_view::npos || type == "bool";
        if (is_whole) {
            if (std::memcmp(valueOf(mine, info), valueOf(other, info), info.size) != 0)
                throw std::runtime_error(
                    fmt::format("{}: cycle {}: {} differs", name_, cycle, ours.name()));
            return;
        }
        for (std::size_t i = 0; i < info.size / sizeof(double); ++i) {
            double a = 0.0;
            double b = 0.0;
            std::memcpy(&a, valueOf(mine, info) + i * sizeof a, sizeof a);
            std::memcpy(&b, valueOf(other, info) + i * sizeof b, sizeof b);
            if (!(std::abs(a - b) <= kTolerance * std::max(1.0, std::abs(b))))
                throw std::runtime_error(
                    fmt::format("{}: cycle {}: {}[{}] is {}, {} in the "
                                "reference",
                                name_, cycle, ours.name(), i, a, b));
        }
    }

    static const rtcf::ComponentRecord& recordOf(const char* library, const std::string& type) {
        void* const opened = dlopen(library, RTLD_NOW | RTLD_LOCAL);
        if (opened == nullptr) throw std::runtime_error(dlerror());
        const auto entry = reinterpret_cast<const rtcf::PluginDescriptor* (*)()>(
            dlsym(opened, RTCF_ENTRY_POINT_NAME));
        if (entry == nullptr) throw std::runtime_error(std::string(library) + ": no components");
        for (const rtcf::ComponentRecord* each = entry()->components; each != nullptr;
             each = each->next)
            if (type == each->type) return *each;
        throw std::runtime_error(std::string(library) + " has no " + type);
    }

    std::string name_;
    rtcf::LoopClock clock_;
    rtcf::ComponentContext context_;
    std::unique_ptr<rtcf::Component> component_;
    std::vector<std::shared_ptr<rtcf::SlotHeader>> slots_;
    std::vector<Feed> feeds_;
    std::vector<rtcf::OutputPort*> outputs_;
    std::size_t written_ = 0;
};

// Medians over the rounds of one contender.
class Times {
   public:
    void add(std::pair<double, double> round) {
        writes_.push_back(round.first);
        all_.push_back(round.second);
    }
    double ofUpdate() const { return median(all_) - median(writes_); }

   private:
    std::vector<double> writes_;
    std::vector<double> all_;
};

std::string row(const char* library, const char* reference_library, const std::string& type) {
    Contender ours(library, type);
    Contender reference(reference_library, type);
    for (int cycle = 0; cycle < kCompared; ++cycle) {
        ours.step();
        reference.step();
        ours.compare(reference, cycle);
    }
    Times our_times;
    Times reference_times;
    for (int round = 0; round < kRounds; ++round) {
        our_times.add(ours.round());
        reference_times.add(reference.round());
    }
    return fmt::format(R"({{"type": "{}", "ns": {:.2f}, "reference_ns": {:.2f}}})", type,
                       our_times.ofUpdate(), reference_times.ofUpdate());
}

}  // namespace

int main(int argc, char** argv) try {
    if (argc < 4) {
        std::fputs("usage: update_cost LIBRARY REFERENCE TYPE...\n", stderr);
        return 2;
    }
    std::vector<std::string> rows;
    for (int i = 3; i < argc; ++i) rows.push_back(row(argv[1], argv[2], argv[i]));
    fmt::print(R"({{"rounds": {}, "updates": {}, "compared": {}, "tolerance": {}, "types": [{}]}})"
               "\n",
               kRounds, kUpdates, kCompared, kTolerance, fmt::join(rows, ", "));
    return 0;
} catch (const std::exception& error) {
    fmt::print(stderr, "update_cost: {}\n", error.what());
    return 1;
}
