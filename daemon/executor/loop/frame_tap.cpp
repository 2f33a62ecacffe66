#include "loop/frame_tap.hpp"

#include <algorithm>
#include <utility>

namespace rtcf::executor {

FrameTap::FrameTap(std::string topic, const TypeInfo& type,
                   std::shared_ptr<const SlotHeader> source)
    : Tap(std::move(topic), type, std::move(source)),
      value_(type.make_slot(nullptr)),
      popped_at_(std::chrono::steady_clock::now()) {}

void FrameTap::follow(std::shared_ptr<const FrameRing> ring, std::size_t output) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!parts_.empty() && parts_.back().ring == ring) return;
    const std::uint64_t first = ring->base();
    add({std::move(ring), output, first, 0});
}

void FrameTap::moveTime(std::int64_t by) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (parts_.empty()) return;
    Part part = parts_.back();
    part.first = part.ring->end();
    part.moved_by = by;
    add(std::move(part));
}

void FrameTap::finish(std::int64_t stamp_ns) {
    std::shared_ptr<SlotHeader> value = type().make_slot(nullptr);
    type().copy(*value, *source());
    const std::lock_guard<std::mutex> lock(mutex_);
    final_ = std::move(value);
    final_stamp_ns_ = stamp_ns;
}

void FrameTap::add(Part part) {
    parts_.push_back(std::move(part));
    if (parts_.size() == 1) next_ = parts_.front().first;
    const bool late = std::chrono::steady_clock::now() - popped_at_ > kPatience;
    while (parts_.size() > 1 && (late || next_ == endOf(0) || parts_.size() > kMostParts ||
                                 bytesOfOldRings() > kMostBytes))
        enterNext();
}

// Leaves the first part; its unread frames are lost.
void FrameTap::enterNext() {
    lose(endOf(0) - next_);
    parts_.pop_front();
    const Part& part = parts_.front();
    next_ = part.first;
    last_stamp_ = movedStamp(last_stamp_, part.moved_by);
}

std::uint64_t FrameTap::endOf(std::size_t part) const {
    const FrameRing* const ring = parts_[part].ring.get();
    // The loop fills the ring no more if there is another one.
    const bool goes_on = part + 1 < parts_.size() && parts_[part + 1].ring.get() == ring;
    return goes_on ? parts_[part + 1].first : ring->end();
}

std::size_t FrameTap::bytesOfOldRings() const {
    std::size_t words = 0;
    const FrameRing* counted = parts_.back().ring.get();
    for (const Part& part : parts_) {
        if (part.ring.get() == std::exchange(counted, part.ring.get())) continue;
        words += part.ring->capacity() * part.ring->wordsOfFrame();
    }
    return words * FrameCopy::kWord;
}

void FrameTap::lose(std::uint64_t frames) {
    lost_ += frames;
    next_ += frames;
}

std::uint64_t FrameTap::waiting() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!popped_ || parts_.empty() || std::chrono::steady_clock::now() - popped_at_ > kPatience)
        return 0;
    std::uint64_t frames = endOf(0) - next_;
    for (std::size_t i = 1; i < parts_.size(); ++i) frames += endOf(i) - parts_[i].first;
    return frames;
}

bool FrameTap::pop(const Use& use) {
    // If a topic is closed and opened again, a new reader can start before the old one has ended.
    const std::unique_lock<std::mutex> reading(consumer_, std::try_to_lock);
    if (!reading.owns_lock()) return false;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        popped_ = true;
        popped_at_ = std::chrono::steady_clock::now();
        if (!findNext()) return false;
    }
    if (build()) use(message_.data(), static_cast<std::uint32_t>(message_.size()), stamp_ns_);
    return true;
}

// Finds the next value to publish.
// @return false if there is none
bool FrameTap::findNext() {
    while (!parts_.empty()) {
        const FrameRing& ring = *parts_.front().ring;
        const std::uint64_t end = endOf(0);
        while (next_ < end) {
            const std::uint64_t written = ring.end();
            if (written - next_ > ring.capacity()) {
                lose(std::min(end, written - ring.capacity()) - next_);
                continue;
            }
            switch (
                ring.readOutput(next_, parts_.front().output, last_stamp_, *value_, stamp_ns_)) {
                case FrameRing::Reading::Overwritten:
                    lose(1);
                    break;
                case FrameRing::Reading::Known:
                    ++next_;
                    lost_ = 0;
                    break;
                case FrameRing::Reading::Copied:
                    ++next_;
                    if (isDue()) return true;
                    break;
            }
        }
        if (parts_.size() == 1) break;
        enterNext();
    }
    if (final_ == nullptr) return false;
    value_ = std::exchange(final_, nullptr);
    stamp_ns_ = final_stamp_ns_;
    return value_->stamp != last_stamp_ && isDue();
}

// Notes the value that was read.
// @return true if it is to be published
bool FrameTap::isDue() {
    last_stamp_ = value_->stamp;
    const std::uint64_t lost = std::exchange(lost_, 0);
    if (last_stamp_ == 0) return false;  // there is no value any more
    const std::uint32_t every = decimation();
    // At least the value of one lost frame was new, and at most that of each.
    if (lost != 0) dropped_.add(std::max<std::uint64_t>(1, lost / every));
    if (++passed_over_ < every) return false;
    passed_over_ = 0;
    return true;
}

// Builds the message of the value.
// @return false if its conversion throws
bool FrameTap::build() {
    try {
        message_.resize(type().length(*value_));
        type().serialize(*value_, message_.data(), static_cast<std::uint32_t>(message_.size()));
        return true;
    } catch (...) {
        dropped_.add(1);
        return false;
    }
}

}  // namespace rtcf::executor
