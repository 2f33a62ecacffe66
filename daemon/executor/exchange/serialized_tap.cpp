#include "exchange/serialized_tap.hpp"

#include <algorithm>
#include <cstring>

namespace rtcf::executor {

SerializedTap::SerializedTap(std::string topic, const TypeInfo& type,
                             std::shared_ptr<const SlotHeader> source, std::size_t capacity,
                             std::size_t largest)
    : Tap(std::move(topic), type, std::move(source)),
      passed_over_(UINT32_MAX - 1),  // so that the first value is taken
      largest_(largest),
      value_(type.builds_message ? type.make_slot(nullptr) : nullptr) {
    ring_.resize(ringBytes(type, capacity));
    mask_ = ring_.size() - 1;
}

std::size_t SerializedTap::valueBytes(const TypeInfo& type) {
    return type.builds_message ? type.size : type.sample().size();
}

std::size_t SerializedTap::recordBytes(const TypeInfo& type) {
    return kHead + padded(valueBytes(type));
}

std::size_t SerializedTap::ringBytes(const TypeInfo& type, std::size_t capacity) {
    const std::size_t one = recordBytes(type);
    // A power of two, so that the offset needs no division.
    std::size_t size = kHead;
    while (size < std::max(capacity, 2 * one)) size *= 2;
    return size;
}

std::uint32_t SerializedTap::lengthAt(std::size_t offset) const noexcept {
    std::uint32_t length = 0;
    std::memcpy(&length, ring_.data() + offset, sizeof length);
    return length;
}

std::int64_t SerializedTap::stampAt(std::size_t offset) const noexcept {
    std::int64_t stamp_ns = 0;
    std::memcpy(&stamp_ns, ring_.data() + offset + kAlign, sizeof stamp_ns);
    return stamp_ns;
}

void SerializedTap::push(std::int64_t stamp_ns) noexcept RTCF_NONBLOCKING {
    const TypeInfo& type = this->type();
    const SlotHeader& source = *this->source();
    if (source.stamp == last_stamp_) return;
    last_stamp_ = source.stamp;
    if (++passed_over_ < decimation()) return;
    passed_over_ = 0;
    auto length = static_cast<std::uint32_t>(type.size);
    if (!type.builds_message) {
        length = type.length(source);
        if (length > largest_) {
            too_large_.add(1);
            return;
        }
    }
    const std::size_t record = kHead + padded(length);
    std::size_t head = head_.load(std::memory_order_relaxed);
    const std::size_t free = mask_ + 1 - (head - tail_.load(std::memory_order_acquire));
    std::size_t offset = head & mask_;
    const std::size_t to_end = mask_ + 1 - offset;
    const std::size_t skipped = record > to_end ? to_end : 0;
    if (record + skipped > free) {
        dropped_.add(1);
        return;
    }
    if (skipped != 0) {
        std::memcpy(ring_.data() + offset, &kSkip, sizeof kSkip);
        head += skipped;
        offset = 0;
    }
    std::memcpy(ring_.data() + offset, &length, sizeof length);
    std::memcpy(ring_.data() + offset + kAlign, &stamp_ns, sizeof stamp_ns);
    std::uint8_t* const to = ring_.data() + offset + kHead;
    if (type.builds_message) {
        std::memcpy(to, valueOf(type, source), length);
    } else {
        type.serialize(source, to, length);
    }
    head_.store(head + record, std::memory_order_release);
}

bool SerializedTap::pop(const Use& use) {
    // If a topic is closed and opened again, a new reader can start before the old one has ended.
    const std::unique_lock<std::mutex> reading(consumer_, std::try_to_lock);
    if (!reading.owns_lock()) return false;
    std::size_t tail = tail_.load(std::memory_order_relaxed);
    const std::size_t head = head_.load(std::memory_order_acquire);
    if (tail == head) return false;
    std::size_t offset = tail & mask_;
    std::uint32_t length = lengthAt(offset);
    if (length == kSkip) {
        tail += mask_ + 1 - offset;
        offset = 0;
        length = lengthAt(0);
    }
    const std::uint8_t* const bytes = ring_.data() + offset + kHead;
    if (!type().builds_message) {
        use(bytes, length, stampAt(offset));
    } else if (build(bytes)) {
        use(message_.data(), static_cast<std::uint32_t>(message_.size()), stampAt(offset));
    }
    tail_.store(tail + kHead + padded(length), std::memory_order_release);
    return true;
}

bool SerializedTap::build(const std::uint8_t* value) {
    std::memcpy(valueOf(type(), *value_), value, type().size);
    try {
        const std::uint32_t length = type().length(*value_);
        if (length > largest_) {
            too_large_.add(1);
            return false;
        }
        message_.resize(length);
        type().serialize(*value_, message_.data(), length);
        return true;
    } catch (...) {
        unbuilt_.add(1);
        return false;
    }
}

}  // namespace rtcf::executor
