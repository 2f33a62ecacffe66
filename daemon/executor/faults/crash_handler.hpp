/// @file
/// What happens in the process when a component crashes it: the note in the
/// flight recorder, then the death it would have died anyway, with a core and
/// off the real-time CPU. rtcfd does the rest.
#pragma once

#include <cstddef>
#include <memory>

#include "faults/flight_recorder.hpp"

namespace rtcf::executor {

/// Takes SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGSYS and SIGTRAP of the whole
/// process. @param recorder outlives the process's threads
void installCrashHandler(FlightRecorder& recorder);

/// Ends the process as stalled; any thread.
[[noreturn]] void dieStalled();

/// Tells the handler which thread this is, and gives the thread a stack on
/// which the handler can run when the thread has used up its own. One object
/// per thread, made and destroyed by that thread.
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

/// The calling thread does another's work as long as this lives: a crash is then that one's.
/// Real-time safe.
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
