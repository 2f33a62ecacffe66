/// @file
/// The flight recorder: shared memory that shows, after any end of the process, what its threads
/// were doing. rtcfd holds it open. executor.proto defines the layout.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "rtcf/realtime.hpp"

namespace rtcf::executor {

/// Role of a thread, as stored in the recorder.
enum class ThreadRole : std::uint32_t { None = 0, Realtime = 1, Graph = 2, Other = 3 };

/// Hook that a thread runs, as stored in the recorder.
enum class Hook : std::uint32_t {
    None = 0,
    Constructor = 1,
    Configure = 2,
    Start = 3,
    Stop = 4,
    Cleanup = 5,
    Prepare = 6,
    // Real-time thread only; None means update() there.
    Safe = 7,
    TakeOver = 8,
    Wait = 9,
    // Graph thread.
    Destructor = 10
};

const char* hookName(Hook hook) noexcept;

/// A hook that the graph thread runs.
struct RunningHook {
    std::string component;  ///< full name; empty = no hook runs
    Hook hook = Hook::None;
    std::uint32_t slot = 0;     ///< of the component; 0 = its library is being opened
    std::int64_t since_ns = 0;  ///< CLOCK_MONOTONIC

    /// E.g. "/H1.prepare"; empty = no hook runs.
    std::string name() const;
};

/// Reason for the end of the process, as stored in the recorder.
enum class CrashReason : std::uint32_t { Signal = 0, Stall = 1 };

class FlightRecorder {
   public:
    static constexpr std::uint32_t kSlots = 10241;  ///< one per component; slot 0 means none
    static constexpr std::size_t kMostFrames = 64;  ///< most stack frames of a crash

    /// @throws std::system_error if there is no memory for it
    FlightRecorder();
    ~FlightRecorder();
    FlightRecorder(const FlightRecorder&) = delete;
    FlightRecorder& operator=(const FlightRecorder&) = delete;

    /// File descriptor, which rtcfd opens by /proc.
    int fd() const noexcept { return fd_; }

    /// @name Slots with the names of components; graph thread
    /// @{
    /// @throws Error if there are too many components
    std::uint32_t addSlot(const std::string& name);
    void removeSlot(std::uint32_t slot) noexcept;
    /// @}

    /// @name Hooks of the graph thread, which notes them
    /// @{
    void enterHook(std::uint32_t slot, Hook hook);
    /// Notes that the library of a component is opened, which runs its static initializers.
    void enterLibrary(const std::string& component);
    void leaveHook() noexcept;
    /// The hook that the graph thread runs. Any thread.
    RunningHook runningHook() const;
    /// @}

    /// @name Notes; real-time safe, each is one store
    /// @{
    /// Notes of the real-time thread, see below.
    class RealtimeNotes;
    inline RealtimeNotes realtimeNotes() noexcept;
    void setRunning(bool running) noexcept RTCF_NONBLOCKING {
        page_->running.store(running ? 1 : 0, std::memory_order_relaxed);
    }
    /// Records a crash; only the first one counts. Async-signal-safe.
    /// @return true if this is the first one
    bool noteCrash(int signal, ThreadRole thread, CrashReason reason, const void* address) noexcept;
    /// Records the call stack of a crash, and the process's memory mappings, which are needed to
    /// find the source lines. Async-signal-safe; once.
    /// @param frames addresses of code, innermost first
    void noteTrace(const void* const* frames, std::size_t count) const noexcept;
    /// @}

    /// Slot of the component that the real-time thread is running; 0 = none.
    std::uint32_t runningSlot() const noexcept {
        return page_->realtime_slot.load(std::memory_order_relaxed);
    }

    /// Component and hook that the real-time thread is running, e.g. "/H1.update"; empty = none.
    /// Not real-time.
    std::string realtimeActivity() const;

   private:
    struct Page {
        std::uint32_t magic;
        std::uint32_t version;
        std::atomic<std::uint64_t> iteration;
        std::atomic<std::uint32_t> realtime_slot;
        std::atomic<std::uint32_t> graph_slot;
        std::atomic<std::uint32_t> graph_hook;
        std::atomic<std::uint32_t> crash_signal;
        std::atomic<std::uint32_t> crash_thread;
        std::atomic<std::uint32_t> crash_reason;
        std::atomic<std::uint64_t> crash_address;
        std::atomic<std::uint32_t> running;
        std::uint32_t slots;
        std::atomic<std::uint32_t> realtime_hook;
        std::uint32_t reserved;
        char names[kSlots][128];  // NOLINT(modernize-avoid-c-arrays): a layout in memory
    };
    static_assert(offsetof(Page, crash_address) == 40 && offsetof(Page, names) == 64,
                  "the layout is in executor.proto");

    void noteGraph(RunningHook hook) noexcept;

    int fd_ = -1;
    Page* page_ = nullptr;
    std::vector<std::uint32_t> free_;
    std::uint32_t next_ = 1;
    mutable std::mutex mutex_;  // of the members below
    RunningHook running_hook_;
};

/// Notes of the real-time thread. Copy the object into a local variable, so that a note is one
/// store. Real-time safe.
class FlightRecorder::RealtimeNotes {
   public:
    void setIteration(std::uint64_t iteration) const noexcept RTCF_NONBLOCKING {
        page_->iteration.store(iteration, std::memory_order_relaxed);
    }
    void enterComponent(std::uint32_t slot) const noexcept RTCF_NONBLOCKING {
        page_->realtime_slot.store(slot, std::memory_order_relaxed);
    }
    /// Notes a hook other than update(), until leaveHook().
    void enterHook(std::uint32_t slot, Hook hook) const noexcept RTCF_NONBLOCKING {
        page_->realtime_hook.store(static_cast<std::uint32_t>(hook), std::memory_order_relaxed);
        enterComponent(slot);
    }
    void leaveHook() const noexcept RTCF_NONBLOCKING {
        enterComponent(0);
        page_->realtime_hook.store(0, std::memory_order_relaxed);
    }
    void leaveComponents() const noexcept RTCF_NONBLOCKING { enterComponent(0); }

   private:
    friend class FlightRecorder;
    explicit RealtimeNotes(Page* page) noexcept : page_(page) {}
    Page* page_;
};

inline FlightRecorder::RealtimeNotes FlightRecorder::realtimeNotes() noexcept {
    return RealtimeNotes(page_);
}

/// Notes a hook of the real-time thread other than update() while it runs. Real-time safe.
class RealtimeHookNote {
   public:
    RealtimeHookNote(const FlightRecorder::RealtimeNotes& notes, std::uint32_t slot,
                     Hook hook) noexcept
        : notes_(notes) {
        notes_.enterHook(slot, hook);
    }
    ~RealtimeHookNote() { notes_.leaveHook(); }
    RealtimeHookNote(const RealtimeHookNote&) = delete;
    RealtimeHookNote& operator=(const RealtimeHookNote&) = delete;

   private:
    const FlightRecorder::RealtimeNotes& notes_;
};

}  // namespace rtcf::executor
