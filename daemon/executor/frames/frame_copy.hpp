/// @file
/// The list of a frame's values, and the code by which the real-time thread copies them. Most
/// values are numbers of a few words: these are gathered several at a time. Larger values, and
/// those that are not whole words, are copied one by one.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "rtcf/realtime.hpp"

namespace rtcf::executor {

class FrameCopy {
   public:
    using Word = std::atomic<std::uint64_t>;
    static constexpr std::size_t kWord = sizeof(std::uint64_t);  ///< bytes

    /// A value of fixed size to copy.
    struct Source {
        const void* from;
        std::size_t size;  ///< bytes
        friend bool operator==(const Source& a, const Source& b) noexcept {
            return a.from == b.from && a.size == b.size;
        }
    };

    explicit FrameCopy(std::vector<Source> sources);

    const std::vector<Source>& sources() const noexcept { return sources_; }
    /// Offset of a source's value among the values, bytes; a multiple of a word.
    std::size_t offset(std::size_t source) const noexcept { return offsets_[source]; }
    /// Size of all values, words.
    std::size_t words() const noexcept { return words_; }
    /// Copies all values. Words are stored with release order: a reader that loads one of them with
    /// acquire order also sees all stores before it. Real-time safe.
    void copy(Word* to) const noexcept RTCF_NONBLOCKING {
        const void* const* from = gathered_.data();
        const void* const* const end = from + gathered_.size();
        Word* next = to;
        for (; from != end; from += kAtOnce, next += kAtOnce) {
            static_assert(kAtOnce == 4, "one line per word below");
            put(next[0], load<std::uint64_t>(from[0]));
            put(next[1], load<std::uint64_t>(from[1]));
            put(next[2], load<std::uint64_t>(from[2]));
            put(next[3], load<std::uint64_t>(from[3]));
        }
        if (!blocks_.empty()) copyBlocks(to);
    }
    /// Copies the value of a source out of copied words. Only by the writer; real-time safe.
    void copyBack(const Word* from, std::size_t source, void* to) const noexcept RTCF_NONBLOCKING;

   private:
    static constexpr std::size_t kAtOnce = 4;  // words gathered at a time

    template <typename T>
    static std::uint64_t load(const void* from) noexcept RTCF_NONBLOCKING {
        T value;
        std::memcpy(&value, from, sizeof value);
        return value;
    }
    static std::uint64_t loadRest(const std::uint8_t* from, std::size_t size) noexcept
        RTCF_NONBLOCKING;
    static void put(Word& word, std::uint64_t value) noexcept RTCF_NONBLOCKING {
        word.store(value, std::memory_order_release);
    }
    void copyBlocks(Word* to) const noexcept RTCF_NONBLOCKING;

    /// A value that is not gathered.
    struct Block {
        const std::uint8_t* from;
        std::size_t words;  ///< whole words
        std::size_t rest;   ///< bytes after the whole words
    };

    std::vector<Source> sources_;
    std::vector<std::size_t> offsets_;
    std::size_t words_ = 0;
    // Sources of the first words; padded to a multiple of kAtOnce.
    std::vector<const void*> gathered_;
    std::vector<Block> blocks_;  // values after the gathered ones
};

}  // namespace rtcf::executor
