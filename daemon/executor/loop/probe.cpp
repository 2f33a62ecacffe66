#include "loop/probe.hpp"

#include <algorithm>
#include <cstring>
#include <memory>

namespace rtcf::executor {

std::size_t Probe::add(const InputPort& input) {
    items_.push_back(
        {&input, nullptr, &input.type(), {}, 0, 0, false, std::vector<std::uint8_t>(kLargest)});
    return items_.size() - 1;
}

std::size_t Probe::add(const OutputPort& output) {
    items_.push_back(
        {nullptr, &output, &output.type(), {}, 0, 0, false, std::vector<std::uint8_t>(kLargest)});
    return items_.size() - 1;
}

bool Probe::takeSome(const LoopClock& clock) noexcept {
    // Copying a byte takes about 1 ns, so this is a thousandth of the period.
    constexpr std::int64_t kLeast = 512;
    std::int64_t left = std::max(kLeast, clock.period_ns / 1000);
    for (; taken_ < items_.size() && left > 0; ++taken_) {
        take(items_[taken_], clock);
        left -= static_cast<std::int64_t>(sizeof(SlotHeader) + items_[taken_].length);
    }
    return taken_ == items_.size();
}

void Probe::take(Item& item, const LoopClock& clock) noexcept {
    const SlotHeader& slot = item.input != nullptr ? item.input->slot() : *item.output->slot();
    item.now_ns = clock.time_ns;
    item.header = slot;
    if (slot.stamp == 0) return;
    const TypeInfo& type = *item.type;
    if (allocatesMessage(type)) return;
    item.length = type.flat ? static_cast<std::uint32_t>(type.size) : type.length(slot);
    item.copied = item.length <= item.bytes.size();
    if (!item.copied) return;
    if (type.flat) {
        std::memcpy(item.bytes.data(), valueOf(type, slot), item.length);
    } else {
        type.serialize(slot, item.bytes.data(), item.length);
    }
}

Probe::Value Probe::value(std::size_t index) const {
    const Item& item = items_[index];
    Value value{item.header.stamp != 0, item.now_ns - timeOf(item.header.stamp), {}};
    if (value.written && allocatesMessage(*item.type)) {
        value.text = "(not shown: its message would be allocated in the cycle)";
    } else if (item.copied) {
        const std::shared_ptr<SlotHeader> slot = item.type->make_slot(nullptr);
        bool valid = true;
        if (item.type->flat) {
            std::memcpy(valueOf(*item.type, *slot), item.bytes.data(), item.length);
        } else {
            valid = item.type->deserialize(*slot, item.bytes.data(), item.length);
        }
        if (valid) value.text = item.type->print(*slot);
    }
    return value;
}

}  // namespace rtcf::executor
