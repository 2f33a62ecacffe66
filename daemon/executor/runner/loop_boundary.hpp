/// @file
/// Changes and copies at the loop's next cycle boundary: waits for the boundary, limits the work of
/// one boundary, and tells why the loop does not reach it. Owned by the runner; graph thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "faults/flight_recorder.hpp"
#include "loop/loop.hpp"
#include "view/settings.hpp"

namespace rtcf::executor {

class LoopBoundary {
   public:
    /// @param runner   name of the runner, for messages
    /// @param settings present settings of the runner
    LoopBoundary(std::string runner, const RunnerSettings& settings, Loop& loop,
                 const FlightRecorder& recorder);

    /// Applies an adoption.
    /// @throws Error if the loop does not apply it in time; nothing has changed then
    void adopt(Adoption& adoption);
    /// Copies values. @throws Error if the loop does not copy them in time
    void capture(Capture& capture);

    /// Most bytes to copy at one boundary.
    std::size_t mostBytes() const;
    /// @param what subject of the message, e.g. "a snapshot"
    /// @throws Error if `bytes` exceeds mostBytes()
    void requireSmall(std::size_t bytes, const char* what) const;

    /// Longest wait for the boundary, ns.
    std::int64_t timeout() const noexcept;
    /// Why the boundary does not come, e.g. "COMPONENT.HOOK() does not return".
    std::string whatHoldsIt() const;

   private:
    const std::string runner_;
    const RunnerSettings& settings_;
    Loop& loop_;
    const FlightRecorder& recorder_;
};

}  // namespace rtcf::executor
