#include "frames/frame_copy.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace rtcf::executor {

namespace {

constexpr std::size_t kMostGathered = 8;            // most words of a gathered source
constexpr std::array<std::uint64_t, 2> kNothing{};  // pads the last group of pairs

enum class Way { Pairs, Singles, Block };

Way wayOf(const FrameCopy::Source& source) {
    const std::size_t words = source.size / FrameCopy::kWord;
    if (source.size % FrameCopy::kWord != 0 || words > kMostGathered) return Way::Block;
    return words % 2 == 0 ? Way::Pairs : Way::Singles;
}

}  // namespace

FrameCopy::FrameCopy(std::vector<Source> sources) : sources_(std::move(sources)) {
    places_.resize(sources_.size());
    const auto each = [this](Way way, const auto& add) {
        for (std::size_t i = 0; i < sources_.size(); ++i) {
            if (wayOf(sources_[i]) != way) continue;
            places_[i] = words_;
            add(static_cast<const std::uint8_t*>(sources_[i].from), sources_[i].size);
            words_ += (sources_[i].size + kWord - 1) / kWord;
        }
    };
    each(Way::Pairs, [this](const std::uint8_t* from, std::size_t size) {
        for (std::size_t at = 0; at < size; at += 2 * kWord) pairs_.push_back(from + at);
    });
    while (pairs_.size() % kAtOnce != 0) pairs_.push_back(kNothing.data());
    words_ = 2 * pairs_.size();
    each(Way::Singles, [this](const std::uint8_t* from, std::size_t size) {
        for (std::size_t at = 0; at < size; at += kWord) singles_.push_back(from + at);
    });
    each(Way::Block, [this](const std::uint8_t* from, std::size_t size) {
        blocks_.push_back({from, size / kWord, size % kWord});
    });
    copies_rest_ = !singles_.empty() || !blocks_.empty();
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

void FrameCopy::copyRest(Word* to) const noexcept RTCF_NONBLOCKING {
    to += 2 * pairs_.size();
    for (const void* from : singles_) put(*to++, load<std::uint64_t>(from));
    for (const Block& block : blocks_) {
        const std::uint8_t* next = block.from;
        for (std::size_t i = 0; i < block.words; ++i, next += kWord, ++to)
            put(*to, load<std::uint64_t>(next));
        if (block.rest != 0) put(*to++, loadRest(next, block.rest));
    }
}

void FrameCopy::copyBack(const Word* from, std::size_t source, void* to) const noexcept
    RTCF_NONBLOCKING {
    from += places_[source];
    auto* next = static_cast<std::uint8_t*>(to);
    for (std::size_t left = sources_[source].size; left != 0; ++from) {
        const std::uint64_t word = from->load(std::memory_order_acquire);
        const std::size_t bytes = std::min(left, kWord);
        std::memcpy(next, &word, bytes);
        next += bytes;
        left -= bytes;
    }
}

}  // namespace rtcf::executor
