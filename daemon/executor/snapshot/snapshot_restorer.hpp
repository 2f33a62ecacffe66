/// @file
/// Restores a snapshot of a runner: assigns each of its values to a place in the graph, or reports
/// the differences. Lives for one restoration; graph thread only.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ordering/plan.hpp"
#include "snapshot/snapshot.hpp"
#include "snapshot/snapshot_taker.hpp"

namespace rtcf::executor {

class SnapshotRestorer {
   public:
    using Batch = std::vector<std::pair<std::string, ParameterValue>>;

    /// Assigns all values.
    /// @param saved outlives this object
    /// @param plan the loop's plan; outlives this object
    /// @param running the loop runs in real time: live state (rtcf::Live) and the values of topics
    /// stay as they are
    /// @throws Error that lists the differences
    SnapshotRestorer(const Snapshot& saved, const Plan& plan, bool running);
    SnapshotRestorer(const SnapshotRestorer&) = delete;
    SnapshotRestorer& operator=(const SnapshotRestorer&) = delete;

    /// The restoration to apply at a boundary.
    Restoration& restoration() noexcept { return restoration_; }
    /// Requires that no value is larger than the capacity that its component has reserved.
    /// @throws Error
    void requireReserved() const;
    /// Parameters to change, and new phases (cycle modulo `every`) of components.
    const std::map<Instance*, Batch>& parameters() const noexcept { return parameters_; }
    const std::map<Instance*, std::uint32_t>& phases() const noexcept { return phases_; }
    /// After the restoration: adds the owners of slots that inputs refer to to the loop's plan.
    void noteIn(Plan& plan) const;

   private:
    void fit(const SnapshotComponent& saved, const GraphNode& node);
    void fitParameters(const SnapshotComponent& saved, Instance& instance);
    void fitStates(const SnapshotComponent& saved, const Instance& instance);
    void fitOutputs(const SnapshotComponent& saved, const Instance& instance);
    void fitInputs(const SnapshotComponent& saved, const Instance& instance);
    void fitInput(const SnapshotInput& saved, InputPort& input, const std::string& name);
    void fitTopics();
    std::int64_t arrivalOf(const SnapshotValue& value) const;
    /// Matches the elements of one kind by name, and calls `fit` for each pair.
    /// @param from elements of the snapshot
    /// @param to elements of the graph
    template <typename From, typename To, typename Name, typename Fit>
    void fitEach(const std::string& of, const char* kind, const From& from, const To& to, Name name,
                 Fit fit);
    /// @param sample slot whose capacity the new slot gets, or null
    std::shared_ptr<SlotHeader> slotFrom(const TypeInfo& type, const SnapshotValue& value,
                                         const std::string& name,
                                         const SlotHeader* sample = nullptr);
    void restoreTo(SlotHeader* to, const TypeInfo& type, const SnapshotValue& value,
                   const std::string& name);
    void problem(std::string text) { problems_.push_back(std::move(text)); }
    void checkStamp(std::int64_t stamp, const std::string& name);
    void requireFit() const;
    void requireTimes() const;

    const Snapshot& snapshot_;
    const Plan& plan_;
    const bool running_;
    const Sources sources_;
    Restoration restoration_;
    std::vector<std::string> problems_;
    // Output and sample.
    std::map<std::string, std::pair<const OutputPort*, const SlotHeader*>> outputs_;
    std::map<const SlotHeader*, std::pair<std::string, const SlotHeader*>> reserved_;
    std::map<Instance*, Batch> parameters_;
    std::map<Instance*, std::uint32_t> phases_;
    std::map<InputPort*, std::shared_ptr<const SlotHeader>> held_;  // values of removed writers
    std::map<const Injector*, std::vector<Restoration::Input>> readers_;
};

}  // namespace rtcf::executor
