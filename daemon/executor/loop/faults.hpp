/// @file
/// Records of faults in a cycle, from the cycle thread to the graph thread: the fault that ended
/// the loop, and the first fault of each kind of each component that did not end it. After rearm(),
/// the next fault is recorded too. Each component has its own record, so that no component's record
/// displaces another's.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>

#include "rtcf/component.hpp"
#include "rtcf/realtime.hpp"
#include "statistics/counter.hpp"

namespace rtcf::executor {

/// Why a loop ended by itself.
struct LoopFault {
    enum class Kind { None, Exception, NotFinite, NoMemory, Overruns };
    Kind kind = Kind::None;
    const Component* component =
        nullptr;  ///< the component that caused it, or null; for comparison only
    /// Full name; the component may be gone when this is read.
    std::array<char, 240> component_name{};
    std::uint64_t iteration = 0;
    std::array<char, 240> text{};  ///< text of the exception, or name of the output
};

/// A fault of a component that does not end the loop.
struct ComponentFault {
    std::uint64_t iteration = 0;
    const char* text = "";
};

/// The first fault of one kind since the loop began, or since rearm().
class FirstFault {
   public:
    static constexpr std::size_t kTextSize = 160;  ///< of a copied text

    /// Allocates the memory for the text of noteCopy(). Not real-time safe.
    void allocateText() { copy_ = std::make_unique<std::array<char, kTextSize>>(); }
    /// Records the fault if it is the first. Cycle thread; real-time safe.
    /// @param text must live as long as the record
    void note(std::uint64_t iteration, const char* text) noexcept RTCF_NONBLOCKING {
        // Acquire: pairs with rearm(), after which the previous fault has been read.
        if (state_.load(std::memory_order_acquire) != State::Empty) return;
        fault_ = {iteration, text};
        state_.store(State::Noted, std::memory_order_release);
    }
    /// The same with a copy of the text, after allocateText().
    void noteCopy(std::uint64_t iteration, const char* text) noexcept RTCF_NONBLOCKING {
        if (state_.load(std::memory_order_acquire) != State::Empty) return;
        if (copy_ != nullptr) std::strncpy(copy_->data(), text, kTextSize - 1);
        note(iteration, copy_ != nullptr ? copy_->data() : "");
    }
    /// Takes the recorded fault. Graph thread.
    /// @return null if there is none, or it was taken before
    const ComponentFault* take() noexcept {
        if (state_.load(std::memory_order_acquire) != State::Noted) return nullptr;
        state_.store(State::Taken, std::memory_order_relaxed);
        return &fault_;
    }
    /// Records the next fault, if this one was taken. Graph thread.
    void rearm() noexcept {
        State taken = State::Taken;
        state_.compare_exchange_strong(taken, State::Empty, std::memory_order_release,
                                       std::memory_order_relaxed);
    }
    /// Removes the record. While no cycle runs.
    void clear() noexcept { state_.store(State::Empty, std::memory_order_relaxed); }

   private:
    enum class State { Empty, Noted, Taken };
    std::atomic<State> state_{State::Empty};
    ComponentFault fault_;
    std::unique_ptr<std::array<char, kTextSize>> copy_;
};

/// Faults of one component since the loop began.
struct ComponentFaults final : FaultSink {
    FirstFault reported;    ///< a fault that the component has reported; its text
    FirstFault not_finite;  ///< an output kept its last finite value; the text is the output's name
    FirstFault taken_out;   ///< an optional component that threw; a copied text
    FirstFault unsafe;      ///< an output of safe() could not be copied for its readers; likewise
    Counter count;          ///< number of all faults, also those not recorded

    void report(std::uint64_t iteration, const char* text) noexcept RTCF_NONBLOCKING override {
        reported.note(iteration, text != nullptr ? text : "a fault without a text");
        count.add(1);
    }
    /// Records the next fault of the kinds that recur, if the last one was taken. Graph thread.
    void rearm() noexcept {
        reported.rearm();
        not_finite.rearm();
    }

    /// While no cycle runs.
    void clear() noexcept {
        reported.clear();
        not_finite.clear();
        taken_out.clear();
        unsafe.clear();
        count.reset();
    }
};

}  // namespace rtcf::executor
