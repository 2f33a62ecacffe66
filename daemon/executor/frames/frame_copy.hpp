/// @file
/// The list of a frame's values, and the code by which the real-time thread copies them. Most are
/// outputs of a few words, each with its stamp: these are gathered, two words at a time. Larger
/// values, and those that are not whole words, are copied one by one.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#if defined(__SSE2__) && !defined(__SANITIZE_THREAD__)
#include <emmintrin.h>
#endif

#include "rtcf/realtime.hpp"

namespace rtcf::executor {

class FrameCopy {
   public:
    using Word = std::atomic<std::uint64_t>;
    static constexpr std::size_t kWord = sizeof(std::uint64_t);  ///< bytes

    /// Memory to copy: a value of fixed size, perhaps after its header.
    struct Source {
        const void* from;
        std::size_t size;      ///< bytes
        std::size_t head = 0;  ///< bytes before the value; a multiple of a word
        friend bool operator==(const Source& a, const Source& b) noexcept {
            return a.from == b.from && a.size == b.size && a.head == b.head;
        }
    };

    explicit FrameCopy(std::vector<Source> sources);

    const std::vector<Source>& sources() const noexcept { return sources_; }
    /// Offset of a source's value among the copied words, bytes; a multiple of a word.
    std::size_t offset(std::size_t source) const noexcept {
        return places_[source] * kWord + sources_[source].head;
    }
    /// Size of all sources, words.
    std::size_t words() const noexcept { return words_; }
    /// Copies all sources. A reader must check afterwards that the words were not overwritten.
    /// Real-time safe.
    void copy(Word* to) const noexcept RTCF_NONBLOCKING {
        // The words follow the mark of an incomplete frame, see FrameRing.
        std::atomic_signal_fence(std::memory_order_seq_cst);
        const void* const* from = pairs_.data();
        const void* const* const end = from + pairs_.size();
        for (Word* next = to; from != end; from += kAtOnce, next += 2 * kAtOnce) {
            static_assert(kAtOnce == 4, "one line per pair below");
            putPair(next, from[0]);
            putPair(next + 2, from[1]);
            putPair(next + 4, from[2]);
            putPair(next + 6, from[3]);
        }
        if (copies_rest_) copyRest(to);
        std::atomic_signal_fence(std::memory_order_seq_cst);
    }
    /// Copies a source out of copied words. Real-time safe.
    void copyBack(const Word* from, std::size_t source, void* to) const noexcept RTCF_NONBLOCKING;
    /// The first word of a source among copied words. Real-time safe.
    std::uint64_t first(const Word* from, std::size_t source) const noexcept RTCF_NONBLOCKING {
        return from[places_[source]].load(std::memory_order_acquire);
    }

   private:
    static constexpr std::size_t kAtOnce = 4;  // pairs gathered at a time

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
    static void putPair(Word* to, const void* from) noexcept RTCF_NONBLOCKING {
#if defined(__SSE2__) && !defined(__SANITIZE_THREAD__)
        // x86 stores each word as a whole, after all earlier stores.
        static_assert(sizeof(Word) == kWord && Word::is_always_lock_free);
        _mm_storeu_si128(reinterpret_cast<__m128i*>(to),
                         _mm_loadu_si128(static_cast<const __m128i*>(from)));
#else
        const auto* const words = static_cast<const std::uint8_t*>(from);
        put(to[0], load<std::uint64_t>(words));
        put(to[1], load<std::uint64_t>(words + kWord));
#endif
    }
    void copyRest(Word* to) const noexcept RTCF_NONBLOCKING;

    /// A source that is not gathered.
    struct Block {
        const std::uint8_t* from;
        std::size_t words;  ///< whole words
        std::size_t rest;   ///< bytes after the whole words
    };

    std::vector<Source> sources_;
    std::vector<std::size_t> places_;  // first word of each source
    std::size_t words_ = 0;
    // Sources of the first words, two words each; padded to a multiple of kAtOnce.
    std::vector<const void*> pairs_;
    std::vector<const void*> singles_;  // sources of an odd number of words, after the pairs
    std::vector<Block> blocks_;         // after these
    bool copies_rest_ = false;          // there are singles or blocks
};

}  // namespace rtcf::executor
