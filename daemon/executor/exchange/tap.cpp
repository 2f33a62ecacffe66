#include "exchange/tap.hpp"

#include <algorithm>
#include <cstring>

namespace rtcf::executor {

Tap::Tap(std::string topic, const TypeInfo& type, std::shared_ptr<const SlotHeader> source,
         std::size_t capacity, std::size_t largest)
    : topic_(std::move(topic)),
      type_(type),
      source_(std::move(source)),
      passed_over_(UINT32_MAX - 1),  // so that the first value is taken
      largest_(type.fixed_size ? SIZE_MAX : largest),
      fixed_length_(type.builds_message || type.fixed_size
                        ? static_cast<std::uint32_t>(valueBytes(type))
                        : 0),
      value_(type.builds_message ? type.make_slot(nullptr) : nullptr) {
    ring_.resize(ringBytes(type, capacity));
    mask_ = ring_.size() - 1;
}

std::size_t Tap::valueBytes(const TypeInfo& type) {
    return type.builds_message ? type.size : type.sample().size();
}

std::size_t Tap::recordBytes(const TypeInfo& type) { return kHead + padded(valueBytes(type)); }

std::size_t Tap::ringBytes(const TypeInfo& type, std::size_t capacity) {
    const std::size_t one = recordBytes(type);
    // A power of two, so that the offset needs no division.
    std::size_t size = kHead;
    while (size < std::max(capacity, 2 * one)) size *= 2;
    return size;
}

std::uint32_t Tap::lengthAt(std::size_t offset) const noexcept {
    std::uint32_t length = 0;
    std::memcpy(&length, ring_.data() + offset, sizeof length);
    return length;
}

std::int64_t Tap::stampAt(std::size_t offset) const noexcept {
    std::int64_t stamp_ns = 0;
    std::memcpy(&stamp_ns, ring_.data() + offset + kAlign, sizeof stamp_ns);
    return stamp_ns;
}

void Tap::push(std::int64_t stamp_ns) noexcept RTCF_NONBLOCKING {
    if (source_->stamp == last_stamp_) return;
    last_stamp_ = source_->stamp;
    if (++passed_over_ < decimation_.load(std::memory_order_relaxed)) return;
    passed_over_ = 0;
    std::uint32_t length = fixed_length_;
    if (length == 0) {
        length = type_.length(*source_);
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
    if (type_.builds_message) {
        std::memcpy(to, valueOf(type_, *source_), length);
    } else {
        type_.serialize(*source_, to, length);
    }
    head_.store(head + record, std::memory_order_release);
}

bool Tap::build(const std::uint8_t* value) {
    std::memcpy(valueOf(type_, *value_), value, type_.size);
    try {
        const std::uint32_t length = type_.length(*value_);
        if (length > largest_) {
            too_large_.add(1);
            return false;
        }
        message_.resize(length);
        type_.serialize(*value_, message_.data(), length);
        return true;
    } catch (...) {
        unbuilt_.add(1);
        return false;
    }
}

}  // namespace rtcf::executor
