/// @file
/// Values copied out of a loop for a snapshot (snapshot/snapshot.hpp), and back in, all at one
/// cycle boundary. The graph thread plans the copies; the cycle thread makes them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "exchange/injector.hpp"
#include "rtcf/component.hpp"
#include "state/state_copy.hpp"

namespace rtcf::executor {

/// The loop's own state between two cycles.
struct ClockState {
    std::uint64_t iteration = 0;        ///< iteration of the next cycle
    std::int64_t time_ns = 0;           ///< loop time of the last cycle
    std::int64_t stamp_ns = 0;          ///< ROS time of the last cycle
    std::int64_t elapsed_ns = 0;        ///< elapsed() in the next cycle
    std::int64_t total_elapsed_ns = 0;  ///< time base of components that do not run every cycle
};

/// Values to copy out of the loop.
struct Capture {
    /// A port's value: flat ones as in memory, others serialised.
    struct Value {
        const TypeInfo* type;
        const SlotHeader* from;
        std::vector<std::uint8_t> bytes;  ///< buffer
        SlotHeader header = {};
        std::uint32_t length = 0;  ///< length of the value, bytes

        /// Copies the value. Real-time safe.
        /// @return false if the buffer is too small
        bool take() noexcept;
    };
    struct Input {
        const InputPort* input;
        const SlotHeader* source;  ///< slot of its writer; null = none, or an injector
        const Injector* injector;  ///< null = none
        Value held;  ///< value of an earlier writer; `from` is null if the input has none
        std::int64_t seen = 0;

        /// Copies the read position and the value of an earlier writer. Real-time safe.
        /// @return false if the buffer is too small
        bool take() noexcept;
    };
    struct Topic {
        const Injector* injector;
        Value value;
    };
    struct Turn {
        const ComponentContext* context;
        std::int64_t updated_ns = 0;
        std::int64_t elapsed_ns = 0;
        bool disabled = false;
    };
    std::vector<StateCopy> states;
    std::vector<Value> values;
    std::vector<Input> inputs;
    std::vector<Topic> topics;
    std::vector<Turn> turns;
    ClockState clock;
    /// Buffers of values of variable size were too small. Their lengths are now known; the caller
    /// has to repeat the capture.
    bool lacks_room = false;

    /// Size of the memory that it touches, in whole cache lines, bytes.
    std::size_t bytes() const;
};

/// Values to copy back into the loop.
struct Restoration {
    struct Value {
        const TypeInfo* type;
        SlotHeader* to;
        std::shared_ptr<SlotHeader> from;  ///< with the capacity of `to`

        /// Puts the value into `to`. If the type owns memory, the values are swapped. Real-time
        /// safe.
        void put() const noexcept;
    };
    struct Input {
        InputPort* input;
        const SlotHeader* source;  ///< slot of its writer; null = none, or an injector
        const SlotHeader* held;    ///< value of an earlier writer; null = none
        std::int64_t seen;

        /// Restores the value and the read position; empties a queue. Real-time safe.
        /// @param other source if none is set
        /// @param later moves the stamps, ns
        void put(const SlotHeader* other, std::int64_t later) const noexcept;
    };
    struct Topic {
        Injector* injector;
        std::shared_ptr<SlotHeader> slot;
        std::int64_t arrived_ns;  ///< CLOCK_MONOTONIC
        std::vector<Input> readers;
    };
    struct Turn {
        ComponentContext* context;
        std::int64_t updated_ns;
        std::int64_t elapsed_ns;
    };
    std::vector<StateCopy> states;
    std::vector<Value> values;
    std::vector<SlotHeader*> headers;  ///< headers whose stamps to move to the loop's time
    std::vector<Input> inputs;
    std::vector<Topic> topics;
    std::vector<Turn> turns;
    ClockState clock;
    /// True = the loop's time continues from the snapshot's (simulated time). False = the loop's
    /// time is the machine's; the ages of values are kept.
    bool sets_time = false;
    /// Filled at the boundary: a component that was taken out after a fault; nothing has changed
    /// then.
    const ComponentContext* taken_out = nullptr;

    /// Size of the memory that it touches, in whole cache lines, bytes.
    std::size_t bytes() const;
};

}  // namespace rtcf::executor
