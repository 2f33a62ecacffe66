#include "check/check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <future>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "bridge/bridge.hpp"
#include "check/undeclared_members.hpp"
#include "common/error.hpp"
#include "common/thrown.hpp"
#include "faults/crash_handler.hpp"
#include "faults/flight_recorder.hpp"
#include "graph/definition.hpp"
#include "logging/log.hpp"
#include "rtcf/read_number.hpp"
#include "runner/runner.hpp"

namespace rtcf::executor {

namespace {

constexpr std::uint64_t kCyclesPerValue = 10;
constexpr std::int64_t kStallTimeout = 120'000'000'000;

// Bridge that replaces the ROS node: it writes a value to every input and reads every output.
class ValueSource final : public Bridge {
   public:
    void configure(const BridgeSettings& /*settings*/) override {}
    void setTable(std::shared_ptr<const BridgeTable> table) override { table_ = std::move(table); }
    void setClock(std::shared_ptr<SimulatedClock> /*clock*/) override {}
    BridgeStatus status() const override { return {}; }

    // Graph thread, like all calls.
    void exchange() {
        for (const auto& injector : table_->inputs) {
            const std::string message = injector->type().sample();
            injector->deliver(reinterpret_cast<const std::uint8_t*>(message.data()),
                              static_cast<std::uint32_t>(message.size()));
        }
        for (const auto& tap : table_->outputs) {
            const TypeInfo& type = tap->type();
            const std::shared_ptr<SlotHeader> value = type.make_slot(nullptr);
            while (tap->pop(
                [&](const std::uint8_t* bytes, std::uint32_t size, std::int64_t /*stamp_ns*/) {
                    if (type.deserialize(*value, bytes, size) && !type.finite(*value))
                        not_finite_.insert(tap->topic());
                })) {
            }
        }
    }

    /// Mapped names of outputs that carried NaN or infinity.
    const std::set<std::string>& notFinite() const noexcept { return not_finite_; }

   private:
    std::shared_ptr<const BridgeTable> table_ = std::make_shared<BridgeTable>();
    std::set<std::string> not_finite_;
};

ParameterValue parseValue(const std::string& text) {
    if (text == "true" || text == "false") return text == "true";
    try {
        std::size_t used = 0;
        if (const long long number = std::stoll(text, &used); used == text.size())
            return std::int64_t{number};
    } catch (const std::logic_error&) {
        // Not an integer.
    }
    if (const std::optional<double> number = readNumber(text)) return *number;
    return text;
}

ComponentDefinition definitionOf(const CheckRequest& request) {
    ComponentDefinition definition;
    definition.name = "checked";
    definition.package = request.package;
    definition.type = request.type;
    for (const std::string& parameter : request.parameters) {
        const std::size_t at = parameter.find(":=");
        if (at == std::string::npos) {
            throw Error(ErrorKind::InvalidArgument,
                        fmt::format("'{}' is not of the form name:=value", parameter));
        }
        definition.parameters.emplace_back(parameter.substr(0, at),
                                           parseValue(parameter.substr(at + 2)));
    }
    return definition;
}

// Prints the present activity to standard output, for `rtcfctl check`, which waits for its end.
void say(const std::string& what) {
    fmt::print("{}\n", what);
    std::fflush(stdout);
}

void run(const CheckRequest& request, Runner& runner, ValueSource& values) {
    const Progress silent = [](const std::string&) {};
    RunnerSettings settings = runner.settings();
    settings.whitelist = ".*";
    settings.loop.warmup_cycles = 0;
    // The sanitizer prints reports inside the cycle, and finding source lines may take seconds.
    settings.stall_timeout_ns = kStallTimeout;
    runner.configure(settings);
    const std::string name = runner.load(definitionOf(request), request.library, say).component;
    // Compares members only after the first cycles, as start() runs before them.
    std::optional<UndeclaredMembers> members;
    for (std::uint64_t done = 0; done < request.cycles; done += kCyclesPerValue) {
        values.exchange();
        say(fmt::format("updating, from cycle {} on", done));
        runner.step(std::min(kCyclesPerValue, request.cycles - done), silent);
        if (!members) members.emplace(runner.component(name));
        members->look();
        if (runner.loop().fault().kind != LoopFault::Kind::None) {
            throw Error(ErrorKind::LoopFailed, runner.status().loop_fault);
        }
    }
    say("stopping");
    runner.stop(silent);
    values.exchange();
    for (const std::string& topic : values.notFinite())
        fmt::print(stderr, "not finite: {}\n", topic);
    if (!members) return;
    for (const std::string& member : members->found())
        fmt::print(stderr, "undeclared: {}\n", member);
}

}  // namespace

int checkComponent(const CheckRequest& request) {
    FlightRecorder recorder;
    installCrashHandler(recorder);
    Log log(
        [](LogEntry&& entry) { fmt::print(stderr, "{}: {}\n", entry.component, entry.message); });
    auto bridge = std::make_unique<ValueSource>();
    ValueSource& values = *bridge;
    Runner runner("check", log, [](const RunnerEvent&) {}, std::move(bridge), recorder);
    std::promise<std::string> outcome;
    runner.post([&] {
        try {
            run(request, runner, values);
            outcome.set_value({});
        } catch (const std::exception& error) {
            outcome.set_value(textOf(error));
        }
    });
    const std::string why = outcome.get_future().get();
    log.drain();
    if (why.empty()) {
        fmt::print(stderr, "{}/{}: {} cycles\n", request.package, request.type, request.cycles);
        return 0;
    }
    fmt::print(stderr, "rtcf-executor: {}\n", why);
    return 1;
}

}  // namespace rtcf::executor
