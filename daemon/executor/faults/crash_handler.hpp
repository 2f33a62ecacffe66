/// @file
/// Handling of a crash inside the process: a note in the flight recorder, then the default action
/// of the signal, with a core, outside of real time. rtcfd does the rest.
#pragma once

#include <cstddef>
#include <memory>

#include "faults/flight_recorder.hpp"

namespace rtcf::executor {

/// Handles SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGSYS and SIGTRAP in the whole process.
/// @param recorder outlives the process's threads
void installCrashHandler(FlightRecorder& recorder);

/// Ends the process, noted as stalled. Any thread.
[[noreturn]] void dieStalled();

/// Sets the calling thread's role for the handler, and gives the thread an alternate signal stack,
/// for a crash by stack overflow. One object per thread, made and destroyed by that thread.
class CrashContext {
   public:
    explicit CrashContext(ThreadRole role);
    ~CrashContext();
    CrashContext(const CrashContext&) = delete;
    CrashContext& operator=(const CrashContext&) = delete;

   private:
    static constexpr std::size_t kStack = 64 * 1024;
    std::unique_ptr<unsigned char[]> stack_;
};

/// Gives the calling thread another role for the life of this object, while it does another
/// thread's work. Real-time safe.
class CrashRole {
   public:
    explicit CrashRole(ThreadRole role) noexcept;
    ~CrashRole();
    CrashRole(const CrashRole&) = delete;
    CrashRole& operator=(const CrashRole&) = delete;

   private:
    ThreadRole before_;
};

}  // namespace rtcf::executor
