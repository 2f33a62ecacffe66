/// @file
/// Real instances of components for tests of the graph without a runner.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "common/error.hpp"
#include "faults/flight_recorder.hpp"
#include "graph/graph.hpp"
#include "logging/log.hpp"
#include "ordering/wiring.hpp"
#include "plugins/library.hpp"

namespace rtcf::test {

class GraphFixture : public ::testing::Test {
   protected:
    /// A configured Mimo of rtcf_examples.
    std::shared_ptr<executor::Instance> mimo(const std::string& name, executor::Remaps remaps,
                                             bool first = false, const std::string& ignore = {}) {
        return make(RTCF_EXAMPLES, "Mimo", name, std::move(remaps), first, ignore);
    }

    std::shared_ptr<executor::Instance> make(const std::string& library, const std::string& type,
                                             const std::string& name, executor::Remaps remaps,
                                             bool first = false, const std::string& ignore = {}) {
        executor::ComponentDefinition definition;
        definition.name = name;
        definition.package = "rtcf_test";
        definition.type = type;
        definition.remaps = std::move(remaps);
        definition.breaks.first = first;
        definition.breaks.ignore = executor::NamePattern("ignore of " + name, ignore);
        auto instance = std::make_shared<executor::Instance>(definition, libraries_.open(library),
                                                             "rt_runner", clock_, log_, recorder_);
        instance->configure();
        return instance;
    }

    /// The five components of Fig. 1, in the order of execution.
    std::vector<std::shared_ptr<executor::Instance>> fig1() {
        return {mimo("H1",
                     {{"in1", "R3_G2H1"},
                      {"in2", "R1_H1R2"},
                      {"in3", "H1_in3"},
                      {"in4", "H1_in4"},
                      {"out1", "H1_F1"},
                      {"out2", "H1_R1R2"}},
                     true),
                mimo("F1", {{"in1", "H1_F1"},
                            {"in2", "F1_in2"},
                            {"in3", "F1_in3"},
                            {"in4", "F1_in4"},
                            {"out1", "F1_R2R3"},
                            {"out2", "F1_out2"}}),
                mimo("R1", {{"in1", "H1_R1R2"},
                            {"in2", "R1_in2"},
                            {"in3", "R1_in3"},
                            {"in4", "R1_in4"},
                            {"out1", "R1_H1R2"},
                            {"out2", "R1_out2"}}),
                mimo("R2", {{"in1", "F1_R2R3"},
                            {"in2", "H1_R1R2"},
                            {"in3", "R1_H1R2"},
                            {"in4", "G2_R2"},
                            {"out1", "R2_R3"},
                            {"out2", "R2_out2"}}),
                mimo("R3", {{"in1", "F1_R2R3"},
                            {"in2", "R2_R3"},
                            {"in3", "R3_in3"},
                            {"in4", "R3_in4"},
                            {"out1", "R3_G2H1"},
                            {"out2", "R3_out2"}})};
    }

    static executor::Graph graphOf(
        const std::vector<std::shared_ptr<executor::Instance>>& instances) {
        executor::Graph graph;
        for (const auto& instance : instances) graph.add({instance, instance->definition().breaks});
        return graph;
    }

    static std::string errorOf(const executor::Graph& graph, const executor::Origin& origin = {}) {
        try {
            executor::wire(graph, {}, origin);
            return {};
        } catch (const executor::Error& refused) {
            return refused.what();
        }
    }

    executor::FlightRecorder recorder_;
    executor::Log log_{[](executor::LogEntry&&) {}};
    LoopClock clock_;
    executor::LibraryStore libraries_;
};

}  // namespace rtcf::test
