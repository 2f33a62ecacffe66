#include "loop/probe.hpp"

#include <memory>

namespace rtcf::executor {

std::size_t Probe::add(const InputBase& input) {
    items_.push_back(
        {&input, nullptr, &input.type(), {}, 0, 0, false, std::vector<std::uint8_t>(kLargest)});
    return items_.size() - 1;
}

std::size_t Probe::add(const OutputBase& output) {
    items_.push_back(
        {nullptr, &output, &output.type(), {}, 0, 0, false, std::vector<std::uint8_t>(kLargest)});
    return items_.size() - 1;
}

void Probe::take(const LoopClock& clock) noexcept {
    now_ns_ = clock.time_ns;
    for (Item& item : items_) {
        const SlotHeader& slot =
            item.input != nullptr ? item.input->newest() : *item.output->slot();
        item.header = slot;
        if (item.input != nullptr) item.seen = item.input->seen();
        if (slot.sequence == 0) continue;
        item.length = item.type->length(slot);
        item.copied = item.length <= item.bytes.size();
        if (item.copied) item.type->serialize(slot, item.bytes.data(), item.length);
    }
}

Probe::Value Probe::value(std::size_t index) const {
    const Item& item = items_[index];
    Value value{item.header.sequence, item.seen, now_ns_ - item.header.time_ns, {}};
    if (item.copied) {
        const std::shared_ptr<SlotHeader> slot = item.type->make_slot(nullptr);
        if (item.type->deserialize(*slot, item.bytes.data(), item.length))
            value.text = item.type->print(*slot);
    }
    return value;
}

}  // namespace rtcf::executor
