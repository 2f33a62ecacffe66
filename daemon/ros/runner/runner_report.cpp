#include "ros/runner/runner_report.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "view/runner_view.hpp"

namespace rtcf::ros1 {

namespace {

using diagnostic_msgs::DiagnosticStatus;

constexpr std::int64_t kLongEnough = 500'000'000;  // ns; shortest time for a rate
constexpr double kEnoughCycles = 5.0;
constexpr double kSlow = 0.9;     // share of the wanted rate below which there is a warning,
constexpr double kFailing = 0.5;  // and an error
using executor::RunnerState;

const char* stateName(RunnerState state) {
    switch (state) {
        case RunnerState::Running:
            return "running";
        case RunnerState::Faulted:
            return "faulted";
        case RunnerState::Stuck:
            return "stuck";
        case RunnerState::Stepping:
            return "stepping";
        case RunnerState::Stopped:
            break;
    }
    return "stopped";
}

template <typename T>
void addValue(DiagnosticStatus& status, const char* key, const T& value) {
    diagnostic_msgs::KeyValue pair;
    pair.key = key;
    pair.value = fmt::format("{}", value);
    status.values.push_back(std::move(pair));
}

void addMicroseconds(DiagnosticStatus& status, const std::string& what,
                     const executor::DistributionSummary& ns) {
    const auto add = [&](const char* which, double value) {
        addValue(status, fmt::format("{} {} (us)", what, which).c_str(),
                 fmt::format("{:.3f}", value * 1e-3));
    };
    if (ns.count == 0) return;
    add("mean", ns.mean);
    add("p99", ns.p99);
    add("p99.9", ns.p999);
}

std::string counted(std::uint64_t count, const char* one, const char* many) {
    return fmt::format("{} {}", count, count == 1 ? one : many);
}

// Raises a status to a more severe level; never lowers it.
void raise(DiagnosticStatus& status, DiagnosticStatus::_level_type level,
           const std::string& message) {
    if (level <= status.level) return;
    status.level = level;
    status.message = message;
}

std::string joined(const std::vector<std::string>& lines) {
    return fmt::format("{}", fmt::join(lines, "; "));
}

}  // namespace

rtcf_msgs::GetLoop::Response describeRunner(const executor::RunnerView& runner) {
    const executor::RunnerStatus present = runner.status();
    const std::shared_ptr<const executor::GraphView> graph = runner.graph();
    const executor::LoopStatistics& statistics = runner.loop().statistics();
    rtcf_msgs::GetLoop::Response response;
    response.runner = runner.name();
    response.state = stateName(present.state);
    response.status = present.loop_fault.empty() ? present.clock_silence : present.loop_fault;
    response.frequency = present.settings.frequency_hz;
    response.iteration = statistics.iteration.load(std::memory_order_relaxed);
    response.overruns = statistics.overruns.value();
    response.generation = graph->generation;
    response.degraded = present.degraded;
    for (std::size_t place = 0; place < graph->components.size(); ++place) {
        const auto& component = graph->components[place];
        rtcf_msgs::LoopComponent info;
        info.name = component->full_name;
        info.package = component->definition->package;
        info.type = component->definition->type;
        info.is_first = component->breaks.first ? 1 : 0;
        info.fault = component->fault;
        for (std::size_t i = 0; i < component->ports->size(); ++i) {
            const executor::MappedPort& port = (*component->ports)[i];
            rtcf_msgs::LoopPort line;
            line.direction = port.output ? rtcf_msgs::LoopPort::OUTPUT : rtcf_msgs::LoopPort::INPUT;
            line.name = port.name;
            line.mapped_name = port.mapped_name;
            line.type = port.type->name;
            const executor::ConnectionView& connection = graph->connectionOf(port);
            line.connected = connection.connected() ? 1 : 0;
            const bool mapped = connection.published || (!port.output && connection.subscribed);
            line.mapped = mapped ? 1 : 0;
            line.broken = !port.output && graph->broken(place, i) ? 1 : 0;
            info.ports.push_back(std::move(line));
        }
        response.component_order.push_back(info.name);
        response.components.push_back(std::move(info));
    }
    for (const executor::ConnectionView& connection : graph->connections) {
        const auto name = [&](const executor::EndpointView& endpoint) {
            return graph->components[endpoint.component]->full_name;
        };
        rtcf_msgs::LoopConnection info;
        info.name = connection.name;
        info.type = connection.type->name;
        if (!connection.writers.empty()) info.writer = name(*connection.writers.begin());
        for (const auto& reader : connection.readers) info.readers.push_back(name(reader));
        info.published = connection.published ? 1 : 0;
        info.subscribed = connection.subscribed ? 1 : 0;
        response.connections.push_back(std::move(info));
    }
    return response;
}

rtcf_msgs::RunnerInfo runnerInfo(const rtcf_msgs::GetLoop::Response& loop) {
    rtcf_msgs::RunnerInfo info;
    for (const rtcf_msgs::LoopComponent& component : loop.components) {
        rtcf_msgs::ComponentInfo to;
        to.name = component.name;
        to.package = component.package;
        to.type = component.type;
        for (const rtcf_msgs::LoopPort& port : component.ports) {
            const bool output = port.direction == rtcf_msgs::LoopPort::OUTPUT;
            rtcf_msgs::PortInfo line;
            line.port_type =
                output ? rtcf_msgs::PortInfo::TYPE_OUTPUT : rtcf_msgs::PortInfo::TYPE_INPUT;
            line.name_remapped = port.mapped_name;
            line.name_unresolved = port.name;
            line.msg_type = port.type;
            line.connected_to_ROS = port.mapped;
            (output ? to.output_ports : to.input_ports).push_back(std::move(line));
        }
        info.components.push_back(std::move(to));
    }
    for (const rtcf_msgs::LoopConnection& connection : loop.connections) {
        // In RTCF 2021, a port without a peer in the loop is not a connection.
        if (connection.writer.empty() || connection.readers.empty()) continue;
        rtcf_msgs::ConnectionInfo to;
        to.name = connection.name;
        to.type = connection.type;
        to.publishing_components.push_back(connection.writer);
        to.subscribing_components = connection.readers;
        to.connected_to_ROS = connection.published != 0 || connection.subscribed != 0 ? 1 : 0;
        info.connections.push_back(std::move(to));
    }
    info.component_order = loop.component_order;
    return info;
}

DiagnosticReport::DiagnosticReport(executor::RunnerView& runner, std::string hardware)
    : runner_(runner), hardware_(std::move(hardware)), name_(runner.name()) {}

diagnostic_msgs::DiagnosticArray DiagnosticReport::take() {
    diagnostic_msgs::DiagnosticArray array;
    array.status.push_back(loopStatus());
    const double ns_per_tick = runner_.loop().counter().nsPerTick();
    std::map<Statistics, Counts> counts;
    const std::shared_ptr<const executor::GraphView> graph = runner_.graph();
    for (const auto& component : graph->components) {
        Counts& last = counts[component->statistics];
        if (const auto found = components_.find(component->statistics); found != components_.end())
            last = std::move(found->second);
        array.status.push_back(componentStatus(name_ + ": " + component->full_name,
                                               component->fault, *component->statistics,
                                               ns_per_tick, last));
    }
    components_ = std::move(counts);
    for (DiagnosticStatus& status : array.status) status.hardware_id = hardware_;
    return array;
}

DiagnosticStatus DiagnosticReport::loopStatus() {
    const executor::RunnerStatus present = runner_.status();
    const executor::Loop& loop = runner_.loop();
    const executor::LoopStatistics& statistics = loop.statistics();
    executor::CycleStatistics& durations = runner_.cycleStatistics();
    durations.count();
    const executor::HistogramSnapshot duration = durations.duration().snapshot();
    const executor::HistogramSnapshot latency = durations.latency().snapshot();
    std::uint64_t taps = 0;
    const std::shared_ptr<const executor::GraphView> graph = runner_.graph();
    for (const auto& tap : graph->taps) taps += tap->dropped();
    std::uint64_t passed_over = 0;
    for (const auto& injector : graph->injectors) passed_over += injector->passedOver();
    const std::uint64_t logs = runner_.logRecordsDropped();
    const std::uint64_t cycles = runner_.cyclesLost();
    const std::uint64_t iteration = statistics.iteration.load(std::memory_order_relaxed);
    const std::int64_t now_ns = executor::monotonicNow();
    const std::uint64_t done = growth(iteration, iteration_);
    const std::int64_t elapsed_ns = time_ns_ == 0 ? 0 : now_ns - time_ns_;
    time_ns_ = now_ns;

    DiagnosticStatus status;
    status.name = name_ + ": loop";
    status.level = DiagnosticStatus::OK;
    status.message = stateName(present.state);
    const std::uint64_t overruns = growth(statistics.overruns.value(), overruns_);
    const std::uint64_t missed = growth(statistics.missed.value(), missed_);
    const std::uint64_t dropped = growth(taps + logs + cycles, dropped_);
    if (dropped != 0) {
        raise(status, DiagnosticStatus::WARN,
              fmt::format("{}: {} dropped in full rings", stateName(present.state),
                          counted(dropped, "record", "records")));
    }
    if (overruns != 0) {
        raise(status, DiagnosticStatus::WARN,
              fmt::format("{}: {}, {} missed", stateName(present.state),
                          counted(overruns, "overrun", "overruns"),
                          counted(missed, "cycle", "cycles")));
    }
    if (!present.degraded.empty()) {
        status.message += ", not in real time: " + joined(present.degraded);
        // Only once, so that it does not hide later warnings.
        if (present.degraded != degraded_) raise(status, DiagnosticStatus::WARN, status.message);
    }
    degraded_ = present.degraded;
    if (!present.clock_silence.empty()) {
        raise(status, DiagnosticStatus::WARN,
              fmt::format("{}: {}", stateName(present.state), present.clock_silence));
    }
    const double wanted_hz = present.settings.frequency_hz;
    const double done_hz =
        elapsed_ns > 0 ? static_cast<double>(done) * 1e9 / static_cast<double>(elapsed_ns) : 0.0;
    // Only if the loop ran during the whole report interval, and in real time.
    const bool runs = loop.running();
    if (runs && ran_ && !present.simulated && elapsed_ns >= kLongEnough &&
        wanted_hz * static_cast<double>(elapsed_ns) * 1e-9 >= kEnoughCycles) {
        const double share = done_hz / wanted_hz;
        const std::string text = fmt::format("{}: {:.1f} Hz instead of {:g} Hz",
                                             stateName(present.state), done_hz, wanted_hz);
        if (share < kFailing) {
            raise(status, DiagnosticStatus::ERROR, text);
        } else if (share < kSlow) {
            raise(status, DiagnosticStatus::WARN, text);
        }
    }
    ran_ = runs;
    if (present.state == RunnerState::Faulted || present.state == RunnerState::Stuck) {
        raise(status, DiagnosticStatus::ERROR,
              fmt::format("{}: {}", stateName(present.state), present.loop_fault));
    }
    addValue(status, "state", stateName(present.state));
    addValue(status, "frequency wanted (Hz)", present.settings.frequency_hz);
    if (elapsed_ns > 0 && loop.running()) {
        addValue(status, "frequency (Hz)", fmt::format("{:.1f}", done_hz));
    }
    addValue(status, "iteration", iteration);
    addValue(status, "components", graph->components.size());
    addValue(status, "overruns", overruns_);
    addValue(status, "missed cycles", missed_);
    addValue(status, "values lost on the way to topics", taps);
    addValue(status, "messages passed over for newer ones", passed_over);
    addValue(status, "log records lost", logs);
    addValue(status, "cycle messages lost", cycles);
    const std::string missing = present.simulated ? "no: follows /clock" : joined(present.degraded);
    addValue(status, "real time", missing.empty() ? "yes" : missing);
    addMicroseconds(status, "calculation",
                    summarize(difference(duration, duration_), loop.counter().nsPerTick()));
    addMicroseconds(status, "wake-up latency", summarize(difference(latency, latency_), 1.0));
    duration_ = duration;
    latency_ = latency;
    return status;
}

DiagnosticStatus DiagnosticReport::componentStatus(const std::string& name,
                                                   const std::string& fault,
                                                   const executor::ComponentStatistics& now,
                                                   double ns_per_tick, Counts& last) {
    DiagnosticStatus status;
    status.name = name;
    status.level = DiagnosticStatus::OK;
    status.message = "ok";
    const executor::HistogramSnapshot duration = now.duration.snapshot();
    const std::uint64_t overruns = growth(now.overruns.value(), last.overruns);
    if (overruns != 0)
        raise(status, DiagnosticStatus::WARN, counted(overruns, "overrun", "overruns"));
    if (!fault.empty()) raise(status, DiagnosticStatus::ERROR, fault);
    addValue(status, "overruns", last.overruns);
    addMicroseconds(status, "update", summarize(difference(duration, last.duration), ns_per_tick));
    last.duration = duration;
    return status;
}

std::uint64_t DiagnosticReport::growth(std::uint64_t now, std::uint64_t& last) {
    const std::uint64_t grown = now >= last ? now - last : now;
    last = now;
    return grown;
}

}  // namespace rtcf::ros1
