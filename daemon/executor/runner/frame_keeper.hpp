/// @file
/// The frames of a loop: the watches that select their values, their memory, and the tables that
/// describe them to readers. Owned by the runner.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "frames/frame_memory.hpp"
#include "logging/log.hpp"
#include "loop/cycle_reader.hpp"
#include "loop/cycle_statistics.hpp"
#include "loop/loop.hpp"
#include "ordering/plan.hpp"
#include "watch/frame_table.hpp"

namespace rtcf::executor {

class FrameKeeper {
   public:
    /// @param loop fills the frames
    /// @param statistics counted from the frames
    FrameKeeper(Loop& loop, CycleStatistics& statistics, Log& log)
        : loop_(loop), statistics_(statistics), log_(log) {}

    /// @name Graph thread
    /// @{
    /// Adds a watch to the next table.
    /// @param number unique number of the watch
    void add(std::uint64_t number, Watch watch);
    /// Removes a watch from the next table. @return false if the number is unknown
    bool remove(std::uint64_t number) { return watches_.erase(number) != 0; }

    /// Makes the frame table of a plan. When the loop has applied the adoption, it fills the
    /// table's ring.
    /// @param frequency_hz frequency of the loop
    /// @param most_bytes see FrameDemand
    std::shared_ptr<const FrameTable> prepare(const Plan& plan, double frequency_hz,
                                              std::size_t most_bytes, Adoption& adoption);
    /// Passes a table to readers. After the loop has begun to fill its ring.
    void publish(std::shared_ptr<const FrameTable> table) noexcept;

    /// Runs steps, which wait for readers of frames and are counted in the statistics; see
    /// Loop::step().
    std::uint64_t step(std::uint64_t cycles, const std::atomic<bool>* given_up);
    /// Runs one step, which does not wait for readers.
    /// @return false if it has not run
    bool stepOnce();
    /// @}

    /// @name Any thread
    /// @{
    /// The tables that were published since the last call. Each describes the frames in its ring,
    /// until the next table's first frame. The last owner must release a table on the graph thread.
    std::vector<std::shared_ptr<const FrameTable>> takePublished();
    /// Sets a function that the graph thread calls when steps wait for readers.
    void onReadersAwaited(std::function<void()> callback);
    const FrameMemory& memory() const noexcept { return memory_; }
    /// Takes the next cycle, for a reader of all cycles. One thread only.
    /// @return false if there is none yet
    bool nextCycle(CycleRecord& cycle);
    /// Passes over the cycles so far.
    void skipCycles();
    /// Cycles that were overwritten before nextCycle() took them.
    std::uint64_t cyclesLost() const;
    /// @}

   private:
    void awaitReaders();
    std::uint64_t waiting() const;

    Loop& loop_;
    CycleStatistics& statistics_;
    Log& log_;

    // Graph thread only.
    FrameMemory memory_;  // outlives the tables' rings
    Watches watches_;
    std::shared_ptr<const FrameTable> table_;  // table of the loop's frames; null before the first
    std::uint64_t uncounted_ = 0;              // steps of stepOnce() since the last count

    mutable std::mutex mutex_;  // protects the following
    std::vector<std::shared_ptr<const FrameTable>> published_;
    std::function<void()> readers_awaited_;
    CycleReader cycles_;  // of nextCycle()
    bool reads_cycles_ = false;
    Frame cycle_;
};

}  // namespace rtcf::executor
