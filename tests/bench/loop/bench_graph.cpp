#include "bench_graph.hpp"

#include <fmt/format.h>

namespace rtcf::bench {

namespace {

constexpr double kFrequencyHz = 2000.0;
constexpr std::int64_t kAdoptionTimeoutNs = 1'000'000'000;

}  // namespace

std::vector<Node> chain(std::size_t length) {
    std::vector<Node> nodes;
    for (std::size_t i = 0; i < length; ++i) {
        Node node{fmt::format("C{:04}", i), {{"out1", fmt::format("/c{:04}", i)}}, false};
        if (i > 0) node.remaps.emplace_back("in1", fmt::format("/c{:04}", i - 1));
        nodes.push_back(std::move(node));
    }
    return nodes;
}

std::vector<Node> paperGraph() {
    return {
        {"H1",
         {{"in1", "/R3_G2H1"}, {"in2", "/R1_H1R2"}, {"out1", "/H1_F1"}, {"out2", "/H1_R1R2"}},
         true},
        {"F1", {{"in1", "/H1_F1"}, {"out1", "/F1_R2R3"}}, false},
        {"R1", {{"in1", "/H1_R1R2"}, {"out1", "/R1_H1R2"}}, false},
        {"R2",
         {{"in1", "/F1_R2R3"},
          {"in2", "/H1_R1R2"},
          {"in3", "/R1_H1R2"},
          {"in4", "/G2_R2"},
          {"out1", "/R2_R3"}},
         false},
        {"R3", {{"in1", "/F1_R2R3"}, {"in2", "/R2_R3"}, {"out1", "/R3_G2H1"}}, false},
    };
}

BenchGraph::BenchGraph(const std::vector<Node>& nodes, const std::string& library,
                       std::string mapped)
    : log_([](executor::LogEntry&&) {}),
      loop_(log_, recorder_, {}),
      code_(libraries_.open(library)),
      mapped_(std::move(mapped)) {
    executor::Graph graph;
    for (const Node& node : nodes) {
        executor::Remaps remaps;
        // A port without a connection gets a private name.
        for (const char* port : {"in1", "in2", "in3", "in4", "out1", "out2"}) {
            remaps.emplace_back(port, fmt::format("/{}/{}", node.name, port));
        }
        for (const auto& [port, connection] : node.remaps) {
            for (auto& [from, to] : remaps) {
                if (from == port) to = connection;
            }
        }
        auto instance = make("Mimo", node.name, std::move(remaps), node.first);
        const executor::LoopBreaks& breaks = instance->definition().breaks;
        graph.add({instance, breaks});
    }
    adopt(graph);
}

std::shared_ptr<executor::Instance> BenchGraph::make(const std::string& type,
                                                     const std::string& name,
                                                     executor::Remaps remaps, bool first) {
    executor::ComponentDefinition definition;
    definition.name = name;
    definition.package = "rtcf_examples";
    definition.type = type;
    definition.remaps = std::move(remaps);
    definition.breaks.first = first;
    auto instance = std::make_shared<executor::Instance>(std::move(definition), code_, "bench",
                                                         loop_.clock(), log_, recorder_);
    instance->configure();
    instance->start();
    return instance;
}

void BenchGraph::adopt(const executor::Graph& graph) {
    executor::Wiring wiring =
        executor::wire(graph, {executor::NamePattern("bench", mapped_), {}}, {});
    executor::Adoption adoption;
    auto plan = executor::buildPlan(graph, std::move(wiring), *plan_, kFrequencyHz, adoption);
    auto frames = executor::makeFrameTable(
        *plan, {{}, kFrequencyHz, 0, loop_.counter(), &frame_memory_, frames_.get()});
    adoption.frames = frames->ring.get();
    loop_.adopt(adoption, kAdoptionTimeoutNs);
    statistics_.follow({frames->ring, frames->components});
    cycles_.follow({frames->ring, frames->components});
    for (const auto& [tap, output] : frames->taps) tap->follow(frames->ring, output);
    frames_ = std::move(frames);
    plan->noteHeld(adoption, *plan_);
    std::swap(plan_, plan);
    order_.clear();
    for (const executor::Step& step : plan_->schedule.steps) order_.push_back(step.component);
}

bool BenchGraph::nextCycle(executor::CycleRecord& cycle) {
    if (cycles_.next(cycle_) == nullptr) return false;
    cycle = cycle_.cycle();
    return true;
}

void BenchGraph::deliver() {
    for (const auto& [topic, injector] : plan_->injectors) {
        const std::shared_ptr<SlotHeader> slot = injector->type().make_slot(nullptr);
        std::vector<std::uint8_t> bytes(injector->type().length(*slot));
        injector->type().serialize(*slot, bytes.data(), static_cast<std::uint32_t>(bytes.size()));
        injector->deliver(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    }
}

BenchGraph::~BenchGraph() {
    loop_.requestStop();
    loop_.join(INT64_MAX);
}

}  // namespace rtcf::bench
