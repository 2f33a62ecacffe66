#include "state/snapshot_work.hpp"

#include <cstring>

namespace rtcf::executor {

namespace {

constexpr std::size_t kLine = 64;

std::size_t lines(std::size_t bytes) { return (bytes + kLine - 1) / kLine * kLine; }

}  // namespace

bool Capture::Value::take() noexcept {
    header = *from;
    length = type->flat ? static_cast<std::uint32_t>(type->size) : type->length(*from);
    if (length > bytes.size()) return false;
    if (type->flat) {
        std::memcpy(bytes.data(), valueOf(*type, *from), length);
    } else {
        type->serialize(*from, bytes.data(), length);
    }
    return true;
}

bool Capture::Input::take() noexcept {
    seen = input->seen();
    const SlotHeader& slot = input->slot();
    const bool own = &slot == (injector != nullptr ? injector->front() : source);
    held.from = own || slot.stamp == 0 ? nullptr : &slot;
    return held.from == nullptr || held.take();
}

void Restoration::Input::put(const SlotHeader* other, std::int64_t later) const noexcept {
    if (QueueBase* const queue = input->queue()) queue->clear();
    const SlotHeader* const own = source != nullptr ? source : other;
    const bool waits = held != nullptr && source != nullptr;
    input->set(held != nullptr ? held : own, movedStamp(seen, later), waits ? source : nullptr);
}

void Restoration::Value::put() const noexcept {
    if (type->flat) {
        type->copy(*to, *from);
        return;
    }
    type->exchange(*to, *from);
    *to = *from;
}

std::size_t Capture::bytes() const {
    std::size_t bytes = (inputs.size() + turns.size()) * kLine;
    for (const StateCopy& state : states) bytes += lines(state.size);
    for (const Value& value : values) bytes += lines(sizeof(SlotHeader) + value.bytes.size());
    for (const Input& input : inputs) bytes += lines(input.held.bytes.size());
    for (const Topic& topic : topics) bytes += lines(sizeof(SlotHeader) + topic.value.bytes.size());
    return bytes;
}

std::size_t Restoration::bytes() const {
    std::size_t bytes = (inputs.size() + turns.size() + topics.size()) * kLine;
    for (const StateCopy& state : states) bytes += lines(state.size);
    for (const Value& value : values) {
        const bool flat = value.type->flat;
        bytes +=
            lines(sizeof(SlotHeader) + (flat ? value.type->size : value.type->length(*value.from)));
    }
    return bytes;
}

}  // namespace rtcf::executor
