/// @file
/// What is copied out of a loop for an image of it (image/image.hpp), and back in, all at one
/// cycle boundary. The graph thread works out what and where; whoever runs the cycle copies.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "exchange/injector.hpp"
#include "rtcf/component.hpp"
#include "state/state_copy.hpp"

namespace rtcf::executor {

/// The loop's own memory between two cycles.
struct ClockImage {
    std::uint64_t iteration = 0;        ///< of the next cycle
    std::int64_t time_ns = 0;           ///< of the last cycle
    std::int64_t stamp_ns = 0;          ///< of the last cycle
    std::int64_t elapsed_ns = 0;        ///< what elapsed() is in the next cycle
    std::int64_t total_elapsed_ns = 0;  ///< what components that skip cycles count in
};

/// Copies out of the loop.
struct Capture {
    /// A value: a flat one as it lies in memory, else serialised.
    struct Value {
        const TypeInfo* type;
        const SlotHeader* from;
        std::vector<std::uint8_t> bytes;  ///< room for it
        SlotHeader header = {};
        std::uint32_t length = 0;  ///< of what was found

        /// Real-time safe. @return whether there was room
        bool take() noexcept;
    };
    struct Input {
        const InputBase* input;
        InputBase::Reading reading = {};
    };
    struct Topic {
        const Injector* injector;
        Value value;
        std::uint64_t sequence = 0;
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
    ClockImage clock;
    /// Values of variable size had no room: their lengths are known now, and it is to be done anew.
    bool lacks_room = false;

    /// Of memory that it touches, in whole cache lines.
    std::size_t bytes() const;
};

/// Copies back into the loop.
struct Restoration {
    struct Value {
        const TypeInfo* type;
        SlotHeader* to;
        std::shared_ptr<SlotHeader> from;  ///< with the room that `to` has

        /// Real-time safe. What was there is then `from`'s, if it has memory of its own.
        void put() const noexcept;
    };
    struct Input {
        InputBase* input;
        InputBase::Reading reading;  ///< source or current null: the one that the input has
    };
    struct Topic {
        Injector* injector;
        std::shared_ptr<SlotHeader> slot;
        std::uint64_t sequence;
        std::vector<Input> readers;
    };
    struct Turn {
        ComponentContext* context;
        std::int64_t updated_ns;
        std::int64_t elapsed_ns;
    };
    std::vector<StateCopy> states;
    std::vector<Value> values;
    std::vector<OutputBase*> staged;   ///< outputs whose staged slots are among these
    std::vector<SlotHeader*> headers;  ///< whose times are to be brought to the loop's
    std::vector<Input> inputs;
    std::vector<Topic> topics;
    std::vector<Turn> turns;
    ClockImage clock;
    /// Time is the loop's own and goes on from the image's; else it is the machine's, and what was
    /// written so long before the image then was written so long before now.
    bool sets_time = false;
    /// Filled at the boundary: this one was taken out after a fault, and nothing has changed.
    const ComponentContext* taken_out = nullptr;

    /// Of memory that it touches, in whole cache lines.
    std::size_t bytes() const;
};

}  // namespace rtcf::executor
