/// @file
/// Takes a snapshot of a runner: plans the copies, and makes a snapshot from them. Lives for one
/// snapshot; graph thread only.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "ordering/plan.hpp"
#include "snapshot/snapshot.hpp"

namespace rtcf::executor {

/// Names of the sources of inputs.
class Sources {
   public:
    /// @param plan outlives this object
    explicit Sources(const Plan& plan);
    /// The source of an input: "/C.out", "/C.out one cycle late", "topic /x"; empty = none.
    std::string of(const InputPort& input) const;

   private:
    const Plan& plan_;
    std::map<const void*, std::string> names_;  // by slot or injector
};

class SnapshotTaker {
   public:
    /// @param plan the loop's plan; outlives this object
    explicit SnapshotTaker(const Plan& plan);
    SnapshotTaker(const SnapshotTaker&) = delete;
    SnapshotTaker& operator=(const SnapshotTaker&) = delete;

    /// The capture to fill at a boundary.
    Capture& capture() noexcept { return capture_; }
    /// Enlarges buffers that were too small.
    void makeRoom();
    /// The snapshot, after the capture.
    /// @throws Error if a component was taken out after a fault
    Snapshot snapshot() const;

   private:
    void addInput(const InputPort& input);
    void add(const TypeInfo& type, const SlotHeader* slot, const SlotHeader* sample);
    SnapshotValue valueAt(const SlotHeader* slot) const;
    SnapshotComponent componentOf(std::size_t step) const;
    SnapshotInput inputOf(const Capture::Input& input) const;

    const Plan& plan_;
    const Sources sources_;
    Capture capture_;
    std::map<const SlotHeader*, std::size_t> values_;  // index into capture_.values
    std::vector<std::vector<std::byte>> states_;       // by step
};

}  // namespace rtcf::executor
