/// @file
/// A request for the present values of ports. The graph thread makes and reads it; the cycle thread
/// fills it. Each value is consistent, but to bound the cost per cycle, the values may come from
/// several boundaries.
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
    /// Result for one port.
    struct Value {
        bool written = false;     ///< there is a value
        std::int64_t age_ns = 0;  ///< loop time since the write, ns
        /// Unset without a value, or if the value is too large to copy.
        std::optional<std::string> text;
    };

    /// Adds a port. @return its index for value()
    std::size_t add(const InputPort& input);
    std::size_t add(const OutputPort& output);

    /// Copies some more values: at least one, and as many bytes as a cycle of this period can
    /// spare. Real-time safe.
    /// @return true if all values are copied
    bool takeSome(const LoopClock& clock) noexcept;
    /// Copies all values; while no loop runs.
    void takeAll(const LoopClock& clock) noexcept {
        while (!takeSome(clock)) {
        }
    }

    /// A value, after all are copied. Not real-time safe.
    Value value(std::size_t index) const;

   private:
    static constexpr std::size_t kLargest = 4096;  // largest copied value, bytes

    struct Item {
        const InputPort* input;  // one of the two is set
        const OutputPort* output;
        const TypeInfo* type;
        SlotHeader header;
        std::int64_t now_ns = 0;
        std::uint32_t length = 0;
        bool copied = false;
        std::vector<std::uint8_t> bytes;
    };

    static void take(Item& item, const LoopClock& clock) noexcept;

    std::vector<Item> items_;
    std::size_t taken_ = 0;
};

}  // namespace rtcf::executor
