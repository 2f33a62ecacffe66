/// @file
/// How the loop tells of what failed in a cycle: what ended the loop, and the
/// first fault of each component that did not, and now and then another. No record can be lost to
/// others: each component has room for its own.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>

#include "rtcf/realtime.hpp"
#include "statistics/counter.hpp"

namespace rtcf {
class Component;
}

namespace rtcf::executor {

/// Why a loop ended by itself.
struct LoopFault {
    enum class Kind { None, Exception, NotFinite, NoMemory, Overruns };
    Kind kind = Kind::None;
    const Component* component =
        nullptr;  ///< the culprit, if it is one component; for comparison only
    std::array<char, 240> component_name{};  ///< its full name, as it may be gone when this is read
    std::uint64_t iteration = 0;
    std::array<char, 240> text{};  ///< text of the exception, or name of the output
};

/// What failed in a component while the loop goes on.
struct ComponentFault {
    std::uint64_t iteration = 0;
    std::array<char, 160> text{};
};

/// Room for the first fault of one kind since the loop began, or since rearm().
class FirstFault {
   public:
    /// Keeps it if it is the first. Whoever runs cycles; real-time safe.
    void note(std::uint64_t iteration, const char* text) noexcept RTCF_NONBLOCKING {
        // Acquire: pairs with rearm(), after which the previous fault has been read.
        if (state_.load(std::memory_order_acquire) != State::Empty) return;
        fault_.iteration = iteration;
        std::strncpy(fault_.text.data(), text, fault_.text.size() - 1);
        state_.store(State::Noted, std::memory_order_release);
    }
    /// Graph thread. @return null if there is none, or it has been taken
    const ComponentFault* take() noexcept {
        if (state_.load(std::memory_order_acquire) != State::Noted) return nullptr;
        state_.store(State::Told, std::memory_order_relaxed);
        return &fault_;
    }
    /// Has the next fault noted, if this one has been taken. Graph thread.
    void rearm() noexcept {
        State told = State::Told;
        state_.compare_exchange_strong(told, State::Empty, std::memory_order_release,
                                       std::memory_order_relaxed);
    }
    /// While no cycle runs.
    void clear() noexcept { state_.store(State::Empty, std::memory_order_relaxed); }

   private:
    enum class State { Empty, Noted, Told };
    std::atomic<State> state_{State::Empty};
    ComponentFault fault_;
};

/// What failed in one component since the loop began.
struct ComponentFaults {
    FirstFault not_finite;  ///< an output that was held; its name is the text
    FirstFault taken_out;   ///< an optional component that threw
    FirstFault unsafe;      ///< a value of safe() that could not be copied for its readers
    Counter count;          ///< of all, those that are not kept included

    /// While no cycle runs.
    void clear() noexcept {
        not_finite.clear();
        taken_out.clear();
        unsafe.clear();
        count.reset();
    }
};

}  // namespace rtcf::executor
