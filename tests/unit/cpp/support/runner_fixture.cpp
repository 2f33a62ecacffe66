#include "support/runner_fixture.hpp"

#include <cmath>
#include <limits>
#include <new>
#include <string_view>

#include <rtcf/read_number.hpp>

namespace rtcf::test {

namespace {

const std::string kLibrary = RTCF_UNIT_COMPONENTS "/rtcf_unit_test.so";
const executor::Progress kSilent = [](const std::string&) {};

}  // namespace

ComponentDefinition definition(const std::string& type, const std::string& name) {
    ComponentDefinition result;
    result.name = name;
    result.package = "rtcf_unit_test";
    result.type = type;
    return result;
}

RunnerFixture::RunnerFixture(std::string cpu_claims)
    : log_([this](LogEntry&& entry) {
          const std::lock_guard<std::mutex> lock(mutex_);
          logged_.push_back(std::move(entry));
      }) {
    journal().clear();
    runner_ = std::make_unique<Runner>(
        "rt_runner", log_,
        [this](const RunnerEvent& event) {
            if (events_are_lost_) throw std::bad_alloc();
            const std::lock_guard<std::mutex> lock(mutex_);
            events_.push_back(event);
        },
        std::make_unique<BridgeKeeper>(bridge_), recorder_, std::move(cpu_claims));
    configure([](RunnerSettings& settings) {
        settings.loop.realtime.lock_memory = false;
        settings.loop.realtime.heap_bytes = 0;
    });
}

RunnerFixture::~RunnerFixture() { journal().gate_open.store(true); }

ChangeOutcome RunnerFixture::load(const ComponentDefinition& component) {
    return onGraphThread([&] { return runner_->load(component, kLibrary, kSilent); });
}

Pending<ChangeOutcome> RunnerFixture::beginLoad(const ComponentDefinition& component) {
    return begin([this, component] { return runner_->load(component, kLibrary, kSilent); });
}

ChangeOutcome RunnerFixture::loadExample(const std::string& type, const std::string& name,
                                         executor::Remaps remaps, bool first) {
    ComponentDefinition component = definition(type, name);
    component.package = "rtcf_examples";
    component.remaps = std::move(remaps);
    component.breaks.first = first;
    return onGraphThread([&] { return runner_->load(component, RTCF_EXAMPLES, kSilent); });
}

void RunnerFixture::loadFig1() {
    const auto loadMimo = [this](const std::string& name, const executor::Remaps& connected) {
        executor::Remaps remaps;
        for (const char* port : {"in1", "in2", "in3", "in4", "out1", "out2"})
            remaps.emplace_back(port, name + "_" + port);
        remaps.insert(remaps.end(), connected.begin(), connected.end());
        loadExample("Mimo", name, remaps, name == "H1");
    };
    loadMimo("R3", {{"in1", "F1_R2R3"}, {"in2", "R2_R3"}, {"out1", "R3_G2H1"}});
    loadMimo("R1", {{"in1", "H1_R1R2"}, {"out1", "R1_H1R2"}});
    loadMimo("H1",
             {{"in1", "R3_G2H1"}, {"in2", "R1_H1R2"}, {"out1", "H1_F1"}, {"out2", "H1_R1R2"}});
    loadMimo("R2", {{"in1", "F1_R2R3"},
                    {"in2", "H1_R1R2"},
                    {"in3", "R1_H1R2"},
                    {"in4", "G2_R2"},
                    {"out1", "R2_R3"}});
    loadMimo("F1", {{"in1", "H1_F1"}, {"out1", "F1_R2R3"}});
}

ChangeOutcome RunnerFixture::unload(const std::string& name) {
    return onGraphThread([&] { return runner_->unload({name}, kSilent); });
}

ChangeOutcome RunnerFixture::replace(const std::string& name,
                                     const ComponentDefinition& component) {
    return onGraphThread(
        [&] { return runner_->replace(name, component, kLibrary, false, kSilent); });
}

ChangeOutcome RunnerFixture::setBreak(const std::string& name, const std::string& port,
                                      bool broken) {
    return onGraphThread([&] { return runner_->setBreaks({{name, port}}, broken); });
}

ChangeOutcome RunnerFixture::setParameters(
    const std::string& name, const std::vector<std::pair<std::string, ParameterValue>>& batch) {
    return onGraphThread([&] { return runner_->setParameters(name, batch); });
}

ChangeOutcome RunnerFixture::start() {
    return onGraphThread([&] { return runner_->start(kSilent); });
}

ChangeOutcome RunnerFixture::stop() {
    return onGraphThread([&] { return runner_->stop(kSilent); });
}

ChangeOutcome RunnerFixture::step(std::uint64_t cycles) {
    return onGraphThread([&] { return runner_->step(cycles, kSilent); });
}

void RunnerFixture::configure(const std::function<void(RunnerSettings&)>& change) {
    onGraphThread([&] {
        RunnerSettings settings = runner_->settings();
        change(settings);
        runner_->configure(settings);
        return true;
    });
}

double RunnerFixture::value(const std::string& component, const std::string& port) {
    const auto graph = runner_->graph();
    const auto& ports = *graph->get(component).ports;
    std::vector<executor::Probe::Value> values;
    // A query waits 0.1 s for the loop, which other load may delay longer.
    EXPECT_TRUE(eventually([&] {
        values = onGraphThread([&] { return runner_->probe(component); });
        return !values.empty();
    })) << component;
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (ports[i].name != port || !values[i].text) continue;
        const std::string& text = *values[i].text;  // "data: 1.5"
        return readNumber(std::string_view(text).substr(text.find(' ') + 1)).value();
    }
    return std::numeric_limits<double>::quiet_NaN();
}

bool RunnerFixture::runs(std::uint64_t cycles) {
    const std::uint64_t target = iteration() + cycles;
    return eventually([&] { return iteration() >= target; });
}

std::vector<std::string> RunnerFixture::order() const {
    std::vector<std::string> names;
    const auto graph = runner_->graph();
    for (const auto& component : graph->components) names.push_back(component->full_name);
    return names;
}

std::vector<RunnerEvent> RunnerFixture::events() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return events_;
}

std::vector<LogEntry> RunnerFixture::logged() {
    log_.drain();
    return handedOn();
}

std::vector<LogEntry> RunnerFixture::handedOn() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return logged_;
}

}  // namespace rtcf::test
