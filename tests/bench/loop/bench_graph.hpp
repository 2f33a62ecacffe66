/// @file
/// Graphs of the paper's Mimo component for the benchmarks, created by the executor's
/// plugin loading, wiring and planning, and run by its loop, without rtcfd, ROS and
/// sockets. Owned by a benchmark's main().
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "faults/flight_recorder.hpp"
#include "logging/log.hpp"
#include "loop/cycle_reader.hpp"
#include "loop/cycle_statistics.hpp"
#include "loop/loop.hpp"
#include "ordering/plan.hpp"
#include "watch/frame_table.hpp"

namespace rtcf::bench {

/// One component of a graph: its name, and the mapped names of its connected ports.
struct Node {
    std::string name;
    std::vector<std::pair<std::string, std::string>> remaps;  ///< port, connection
    bool first = false;
};

/// `length` components, each reading its predecessor by one connection.
std::vector<Node> chain(std::size_t length);

/// The example architecture of the paper, Fig. 1.
std::vector<Node> paperGraph();

/// A graph and a loop that has adopted it.
class BenchGraph {
   public:
    /// @param library of rtcf_examples
    /// @param mapped  regular expression of connections that get a tap or an injector; empty = none
    /// @throws executor::Error
    BenchGraph(const std::vector<Node>& nodes, const std::string& library, std::string mapped = {});
    ~BenchGraph();

    executor::Loop& loop() noexcept { return loop_; }
    /// Takes the next cycle of the loop. @return false if there is none yet
    bool nextCycle(executor::CycleRecord& cycle);
    /// Cycles that were overwritten before nextCycle() took them.
    std::uint64_t cyclesLost() const noexcept { return cycles_.lost(); }
    /// Durations of the cycles and components so far.
    const executor::CycleStatistics& statistics() {
        statistics_.count();
        return statistics_;
    }
    executor::Plan& plan() noexcept { return *plan_; }
    /// Writes a new value to each mapped input, as a topic does.
    void deliver();
    /// Creates a component outside the graph. @param remaps of its ports
    std::shared_ptr<executor::Instance> make(const std::string& type, const std::string& name,
                                             executor::Remaps remaps = {}, bool first = false);
    /// Replaces the graph that the loop runs.
    void adopt(const executor::Graph& graph);
    /// The components in order of execution.
    const std::vector<Component*>& order() const noexcept { return order_; }

   private:
    executor::Log log_;
    executor::FlightRecorder recorder_;
    executor::FrameMemory frame_memory_;
    std::shared_ptr<const executor::FrameTable> frames_;
    executor::Loop loop_;
    executor::CycleStatistics statistics_{loop_.statistics()};
    executor::CycleReader cycles_;
    executor::Frame cycle_;
    executor::LibraryStore libraries_;
    std::shared_ptr<const executor::Library> code_;
    const std::string mapped_;
    std::unique_ptr<executor::Plan> plan_ = std::make_unique<executor::Plan>();
    std::vector<Component*> order_;
};

}  // namespace rtcf::bench
