/// @file
/// A look at the values of some ports. Built by the graph thread, filled by
/// whoever runs the cycle, read by the graph thread. Each value is whole; so that
/// looking costs no cycle much, they may be of several boundaries.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::executor {

class Probe {
   public:
    /// What was found at one port.
    struct Value {
        std::uint64_t sequence = 0;       ///< writes so far; 0 = there is no value
        std::uint64_t seen = 0;           ///< input: writes its component has read
        std::int64_t age_ns = 0;          ///< loop time since the write, ns
        std::optional<std::string> text;  ///< unset without a value, or if it is too large to copy
    };

    /// Adds a port. @return its index for value()
    std::size_t add(const InputBase& input);
    std::size_t add(const OutputBase& output);

    /// Copies some more values: one at least, and as many bytes as a cycle of this period can
    /// spare. Real-time safe. @return whether that was all
    bool takeSome(const LoopClock& clock) noexcept;
    /// While no loop runs.
    void takeAll(const LoopClock& clock) noexcept {
        while (!takeSome(clock)) {
        }
    }

    /// Once all are taken. Not real-time safe.
    Value value(std::size_t index) const;

   private:
    static constexpr std::size_t kLargest = 4096;  // bytes of a value that is copied

    struct Item {
        const InputBase* input;  // one of the two is set
        const OutputBase* output;
        const TypeInfo* type;
        SlotHeader header;
        std::int64_t now_ns = 0;
        std::uint64_t seen = 0;
        std::uint32_t length = 0;
        bool copied = false;
        std::vector<std::uint8_t> bytes;
    };

    static void take(Item& item, const LoopClock& clock) noexcept;

    std::vector<Item> items_;
    std::size_t taken_ = 0;
};

}  // namespace rtcf::executor
