#include "frames/frame_ring.hpp"

namespace rtcf::executor {

namespace {

std::int64_t signedOf(std::uint64_t word) { return static_cast<std::int64_t>(word); }

// A power of two, so that the index needs no division.
std::size_t capacityOf(std::size_t words_of_frame, std::size_t frames) {
    std::size_t capacity = FrameRing::kFewestFrames;
    while (capacity < frames &&
           2 * capacity * words_of_frame * FrameCopy::kWord <= FrameRing::kLargestRing)
        capacity *= 2;
    return capacity;
}

}  // namespace

FrameRing::FrameRing(std::vector<Source> sources, std::size_t steps, std::size_t frames,
                     const CycleCounter& counter, FrameMemory* memory)
    : copy_(std::move(sources)),
      counter_(counter),
      steps_(steps),
      stride_(kHeadWords + steps + copy_.words()),
      mask_(capacityOf(stride_, frames) - 1) {
    const std::size_t words = capacity() * stride_;
    if (memory != nullptr) block_ = memory->take(words * FrameCopy::kWord);
    if (block_ == nullptr) {
        // Touches the memory here, so that the loop has no page faults.
        own_ = std::make_unique<Word[]>(words);  // NOLINT(modernize-avoid-c-arrays)
        for (std::size_t i = 0; i < words; ++i) own_[i].store(0, std::memory_order_relaxed);
    }
    base_ = std::make_unique<Word[]>(copy_.words());  // NOLINT(modernize-avoid-c-arrays)
    words_ = block_ != nullptr ? block_->words() : own_.get();
    writing_ = words_;
}

std::size_t FrameRing::capacityFor(const std::vector<Source>& sources, std::size_t steps,
                                   std::size_t frames) {
    return capacityOf(kHeadWords + steps + FrameCopy(sources).words(), frames);
}

CycleTicks FrameRing::lastTicks() const noexcept RTCF_NONBLOCKING {
    const Word* const frame = at(end_.load(std::memory_order_relaxed) - 1);
    const auto get = [frame](Head place) {
        return signedOf(frame[place].load(std::memory_order_relaxed));
    };
    return {get(kBegin), get(kReady), get(kEnd)};
}

void FrameRing::putBack(void* from) const noexcept RTCF_NONBLOCKING {
    const std::uint64_t end = end_.load(std::memory_order_relaxed);
    const Word* const last = end == base_end_ ? base_.get() : at(end - 1) + kHeadWords + steps_;
    for (std::size_t i = 0; i < copy_.sources().size(); ++i) {
        if (copy_.sources()[i].from == from) copy_.copyBack(last, i, from);
    }
}

bool FrameRing::read(std::uint64_t number, Frame& frame, std::size_t words) const {
    const Word* const word = at(number);
    const auto get = [word](std::size_t place) {
        return word[place].load(std::memory_order_acquire);
    };
    const std::uint64_t whole = 2 * number + 2;
    if (get(kMark) != whole) return false;
    frame.ticks_ = {signedOf(get(kBegin)), signedOf(get(kReady)), signedOf(get(kEnd))};
    frame.cycle_ = {get(kIteration), signedOf(get(kStamp)), signedOf(get(kLatency)),
                    counter_.toNs(frame.ticks_.end - frame.ticks_.begin)};
    frame.kind_ = static_cast<FrameKind>(get(kKind) & ~kRestored);
    frame.steps_ = steps_;
    frame.words_.resize(words);
    for (std::size_t i = 0; i < words; ++i) frame.words_[i] = get(kHeadWords + i);
    return get(kMark) == whole;
}

FrameRing::Reading FrameRing::readOutput(std::uint64_t number, std::size_t source,
                                         std::int64_t known, SlotHeader& to,
                                         std::int64_t& stamp_ns) const {
    const Word* const frame = at(number);
    const Word* const values = frame + kHeadWords + steps_;
    const std::uint64_t whole = 2 * number + 2;
    if (frame[kMark].load(std::memory_order_acquire) != whole) return Reading::Overwritten;
    const bool restored = (frame[kKind].load(std::memory_order_acquire) & kRestored) != 0;
    const bool is_known = !restored && signedOf(copy_.first(values, source)) == known;
    if (!is_known) {
        stamp_ns = signedOf(frame[kStamp].load(std::memory_order_acquire));
        copy_.copyBack(values, source, &to);
    }
    if (frame[kMark].load(std::memory_order_acquire) != whole) return Reading::Overwritten;
    return is_known ? Reading::Known : Reading::Copied;
}

}  // namespace rtcf::executor
