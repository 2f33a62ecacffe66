/// @file
/// Changes of a runner's graph. Every change is a transaction: new components are constructed and
/// configured beside the running loop; the new graph is wired and ordered; new components are
/// started; the loop adopts the change at one cycle boundary; then cleanUpLeft() stops and cleans
/// up leaving components. A failure before the adoption leaves everything as it was. Owned by the
/// runner; graph thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "graph/definition.hpp"
#include "graph/difference.hpp"
#include "logging/log.hpp"
#include "loop/loop.hpp"
#include "ordering/plan.hpp"
#include "ordering/wiring.hpp"
#include "runner/active_plan.hpp"
#include "runner/bridge_link.hpp"
#include "runner/change_outcome.hpp"
#include "runner/component_loader.hpp"
#include "runner/frame_keeper.hpp"
#include "runner/loop_boundary.hpp"
#include "runner/loop_control.hpp"
#include "runner/publication.hpp"
#include "view/settings.hpp"

namespace rtcf::executor {

class Transactions {
   public:
    /// The parts of a change of the graph.
    struct Change {
        Graph graph;
        Origin origin;                  // for messages
        std::set<std::string> changed;  // components to copy into the graph view again
        std::vector<std::shared_ptr<Instance>> arriving;
        std::vector<std::shared_ptr<Instance>> leaving;
        std::vector<StagedValue*> values;
        std::vector<HandOver> hand_overs;
        std::vector<StateCopy> copies;
        Restoration* restoration = nullptr;
        std::vector<std::string> notes;  // notes on the hand-over of state
        std::int64_t period_ns = 0;      // 0 = the period stays
    };

    /// @param runner   name of the runner, for messages
    /// @param settings present settings of the runner
    /// All references outlive this object.
    Transactions(std::string runner, const RunnerSettings& settings, const Loop& loop,
                 LoopBoundary& boundary, LoopControl& control, ActivePlan& plan,
                 FrameKeeper& frames, const Publication& publication, BridgeLink& bridge,
                 ComponentLoader& loader, Log& log);

    /// Limits the number of published outputs; later changes beyond the limit are rejected.
    void limitTaps(std::size_t most) noexcept { most_taps_ = most; }
    /// Rejects changes while a replay runs, or accepts them again.
    void setReplaying(bool replaying) noexcept { replaying_ = replaying; }
    /// @throws Error while a replay runs
    void requireNoReplay() const;

    /// @name Changes of the graph. If one throws, it has changed nothing.
    /// @{
    ChangeOutcome load(ComponentDefinition definition, const std::string& library,
                       const Progress& progress);
    ChangeOutcome unload(const std::vector<std::string>& names, const Progress& progress);
    /// @param reset true = parameters that `definition` does not set get their defaults; false =
    /// they keep valid values of the old component
    ChangeOutcome replace(const std::string& name, ComponentDefinition definition,
                          const std::string& library, bool reset, const Progress& progress);
    /// Changes the graph to the wanted one, in one transaction.
    /// @param dry_run only computes the differences
    ChangeOutcome apply(const std::vector<WantedComponent>& wanted, bool dry_run,
                        const Progress& progress);
    ChangeOutcome setBreaks(const std::vector<std::pair<std::string, std::string>>& ports,
                            bool broken);
    /// Applies changed settings: the period if it is not 0, connections and their sizes.
    void applySettings(std::int64_t period_ns);
    /// Recreates all components with the same parameters, but without state and old values of
    /// inputs.
    void renewComponents(const Progress& progress);
    /// Gives an input without a writer an injector, for values from outside.
    /// @param topic mapped name of the input
    void makeWritable(const std::string& topic);
    /// Wires, starts and adopts a change.
    /// @return notes on the hand-over of state
    /// @throws Error and others; nothing has changed then
    std::vector<std::string> adopt(Change change, const Progress& progress);
    /// @}

    /// Stops, cleans up and destroys the components that have left the graph. Separate from their
    /// change, whose outcome no longer depends on these hooks: they may take long, or forever.
    void cleanUpLeft() noexcept;

    /// @name Changes of frames
    /// @{
    /// Keeps the values of a watch in frames.
    /// @param watch unique number of the watch
    /// @param allow_missing true = its selection may match nothing yet
    void watch(std::uint64_t watch, Watch wanted, bool allow_missing);
    /// Ends a watch; does nothing if the number is unknown.
    void endWatch(std::uint64_t watch);
    /// Gives the loop frames for the present graph and watches.
    void adoptFrames();
    /// @}

   private:
    /// Makes the components to load, in the order of execution: constructionOrder().
    /// @param look true = does not configure them
    /// @return by difference; null for those that load none
    std::vector<std::shared_ptr<Instance>> makeComponents(
        const std::vector<Difference>& differences, const Progress& progress, bool look);
    /// Adds a difference to a change.
    /// @param made the component to load; null if there is none
    void addDifference(Change& change, const Difference& difference,
                       const std::shared_ptr<Instance>& made);
    /// Plans the hand-over of state to a replacement.
    void handOver(Change& change, const Instance& previous, const Instance& successor) const;
    /// Publishes a change that the loop has adopted.
    void adopted(const Change& change);
    std::shared_ptr<const FrameTable> framesOf(const Plan& plan, Adoption& adoption);
    void checkTaps(const Wiring& wiring) const;
    ChangeOutcome outcomeOf(const Instance& arrived) const;
    void addRemarks(ChangeOutcome& outcome, const std::set<std::string>& components) const;
    MappingFilter filter() const;

    const std::string runner_;
    const RunnerSettings& settings_;
    const Loop& loop_;
    LoopBoundary& boundary_;
    LoopControl& control_;
    ActivePlan& plan_;
    FrameKeeper& frames_;
    const Publication& publication_;
    BridgeLink& bridge_;
    ComponentLoader& loader_;
    Log& log_;
    std::set<std::string> written_;  // mapped names of inputs of makeWritable()
    std::size_t most_taps_ = SIZE_MAX;
    bool replaying_ = false;

    // Components that have left the graph, and the plan that they use until they are cleaned up.
    struct Left {
        std::unique_ptr<Plan> plan;
        std::vector<std::shared_ptr<Instance>> components;
    };
    std::vector<Left> left_;
};

}  // namespace rtcf::executor
