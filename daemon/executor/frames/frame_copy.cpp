#include "frames/frame_copy.hpp"

#include <algorithm>
#include <utility>

namespace rtcf::executor {

namespace {

constexpr std::size_t kMostGathered = 4;  // most words of a gathered value
constexpr std::uint64_t kNothing = 0;     // pads the last group

bool isGathered(const FrameCopy::Source& source) {
    return source.size % FrameCopy::kWord == 0 && source.size / FrameCopy::kWord <= kMostGathered;
}

}  // namespace

FrameCopy::FrameCopy(std::vector<Source> sources) : sources_(std::move(sources)) {
    offsets_.resize(sources_.size());
    for (std::size_t i = 0; i < sources_.size(); ++i) {
        if (!isGathered(sources_[i])) continue;
        offsets_[i] = gathered_.size() * kWord;
        const auto* const from = static_cast<const std::uint8_t*>(sources_[i].from);
        for (std::size_t at = 0; at < sources_[i].size; at += kWord) gathered_.push_back(from + at);
    }
    while (gathered_.size() % kAtOnce != 0) gathered_.push_back(&kNothing);
    words_ = gathered_.size();
    for (std::size_t i = 0; i < sources_.size(); ++i) {
        const Source& source = sources_[i];
        if (isGathered(source)) continue;
        offsets_[i] = words_ * kWord;
        blocks_.push_back({static_cast<const std::uint8_t*>(source.from),
                           source.size / FrameCopy::kWord, source.size % FrameCopy::kWord});
        words_ += (source.size + kWord - 1) / kWord;
    }
}

// Loads the bytes after the last whole word into a word, in memory order. On little-endian
// machines, the common sizes take one load.
std::uint64_t FrameCopy::loadRest(const std::uint8_t* from, std::size_t size) noexcept
    RTCF_NONBLOCKING {
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    if (size == 1) return load<std::uint8_t>(from);
    if (size == 2) return load<std::uint16_t>(from);
    if (size == 4) return load<std::uint32_t>(from);
#endif
    std::uint64_t value = 0;
    std::memcpy(&value, from, size);
    return value;
}

void FrameCopy::copyBlocks(Word* to) const noexcept RTCF_NONBLOCKING {
    to += gathered_.size();
    for (const Block& block : blocks_) {
        const std::uint8_t* next = block.from;
        for (std::size_t i = 0; i < block.words; ++i, next += kWord, ++to)
            put(*to, load<std::uint64_t>(next));
        if (block.rest != 0) put(*to++, loadRest(next, block.rest));
    }
}

void FrameCopy::copyBack(const Word* from, std::size_t source, void* to) const noexcept
    RTCF_NONBLOCKING {
    from += offsets_[source] / kWord;
    auto* next = static_cast<std::uint8_t*>(to);
    for (std::size_t left = sources_[source].size; left != 0; ++from) {
        const std::uint64_t word = from->load(std::memory_order_relaxed);
        const std::size_t bytes = std::min(left, kWord);
        std::memcpy(next, &word, bytes);
        next += bytes;
        left -= bytes;
    }
}

}  // namespace rtcf::executor
