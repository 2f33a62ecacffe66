#include "frames/frame_ring.hpp"

#include <algorithm>
#include <cstring>

namespace rtcf::executor {

namespace {

constexpr std::size_t kWord = sizeof(std::uint64_t);

std::int64_t signedOf(std::uint64_t word) { return static_cast<std::int64_t>(word); }

std::size_t wordsOf(const FrameRing::Source& source) { return (source.size + kWord - 1) / kWord; }

}  // namespace

FrameRing::FrameRing(std::vector<Source> sources, std::size_t frames, FrameMemory* memory)
    : sources_(std::move(sources)) {
    mask_ = capacityFor(sources_, frames) - 1;
    for (const Source& source : sources_) {
        offsets_.push_back((stride_ - kHeadWords) * kWord);
        stride_ += wordsOf(source);
    }
    const std::size_t words = capacity() * stride_;
    if (memory != nullptr) block_ = memory->take(words * kWord);
    if (block_ != nullptr) {
        words_ = block_->words();
        return;
    }
    // Written here for the first time, not in the loop.
    own_ = std::make_unique<Word[]>(words);  // NOLINT(modernize-avoid-c-arrays)
    words_ = own_.get();
    for (std::size_t i = 0; i < words; ++i) words_[i].store(0, std::memory_order_relaxed);
}

// A power of two, so that a place in the ring is found without a division.
std::size_t FrameRing::capacityFor(const std::vector<Source>& sources,
                                   std::size_t frames) noexcept {
    std::size_t words = kHeadWords;
    for (const Source& source : sources) words += wordsOf(source);
    std::size_t capacity = kFewestFrames;
    while (capacity < frames && 2 * capacity * words * kWord <= kLargestRing) capacity *= 2;
    return capacity;
}

// A reader that has seen any of the words stored here sees the mark before them, too.
void FrameRing::take() noexcept RTCF_NONBLOCKING {
    Word* word = at(next_);
    word[kMark].store(2 * next_ + 1, std::memory_order_relaxed);
    word += kHeadWords;
    for (const Source& source : sources_) {
        const auto* from = static_cast<const std::uint8_t*>(source.from);
        std::size_t left = source.size;
        std::uint64_t value = 0;
        for (; left >= kWord; left -= kWord, from += kWord, ++word) {
            std::memcpy(&value, from, kWord);
            word->store(value, std::memory_order_release);
        }
        if (left == 0) continue;
        value = 0;
        std::memcpy(&value, from, left);
        word->store(value, std::memory_order_release);
        ++word;
    }
}

void FrameRing::commit(const CycleRecord& cycle, bool last_of_loop) noexcept RTCF_NONBLOCKING {
    Word* const word = at(next_);
    const auto put = [word](Head place, std::uint64_t value) {
        word[place].store(value, std::memory_order_release);
    };
    put(kIteration, cycle.iteration);
    put(kStamp, static_cast<std::uint64_t>(cycle.stamp_ns));
    put(kLatency, static_cast<std::uint64_t>(cycle.latency_ns));
    put(kDuration, static_cast<std::uint64_t>(cycle.duration_ns));
    put(kLast, last_of_loop ? 1 : 0);
    put(kMark, 2 * next_ + 2);
    ++next_;
    end_.store(next_, std::memory_order_release);
}

bool FrameRing::read(std::uint64_t number, Frame& frame) const {
    const Word* const word = at(number);
    const auto get = [word](std::size_t place) {
        return word[place].load(std::memory_order_acquire);
    };
    const std::uint64_t whole = 2 * number + 2;
    if (get(kMark) != whole) return false;
    frame.cycle_ = {get(kIteration), signedOf(get(kStamp)), signedOf(get(kLatency)),
                    signedOf(get(kDuration))};
    frame.last_of_loop_ = get(kLast) != 0;
    frame.words_.resize(stride_ - kHeadWords);
    for (std::size_t i = 0; i < frame.words_.size(); ++i) frame.words_[i] = get(kHeadWords + i);
    return get(kMark) == whole;
}

}  // namespace rtcf::executor
