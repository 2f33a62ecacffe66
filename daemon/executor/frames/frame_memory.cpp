#include "frames/frame_memory.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <new>
#include <system_error>
#include <utility>

namespace rtcf::executor {

namespace {

constexpr std::uint32_t kFramesMagic = 0x42435452;  // "RTCB"
constexpr std::uint32_t kFramesVersion = 2;
// Bytes; block sizes are powers of two, so that blocks can be reused.
constexpr std::size_t kSmallest = 4096;

// Maps a range of the file, with all pages present, and locked if the process's memory is.
void* mapped(int fd, std::uint64_t offset, std::size_t bytes) {
    void* memory = MAP_FAILED;
    if (::ftruncate(fd, static_cast<off_t>(offset + bytes)) == 0) {
        memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd,
                        static_cast<off_t>(offset));
    }
    if (memory == MAP_FAILED)
        throw std::system_error(errno, std::generic_category(), "no memory for frames");
    return memory;
}

}  // namespace

struct FrameMemory::Directory {
    struct Entry {
        std::atomic<std::uint64_t> sequence;  // 0 = unused
        std::uint64_t words_offset;
        std::uint64_t frames;
        std::uint64_t words_of_frame;
        std::uint64_t layout_offset;
        std::uint64_t layout_bytes;
    };

    std::uint32_t magic;
    std::uint32_t version;
    std::array<Entry, kRings> entries;
};

FrameBlock::FrameBlock(int fd, std::uint64_t offset, std::size_t bytes)
    : words_(static_cast<Word*>(mapped(fd, offset, bytes))), offset_(offset), bytes_(bytes) {}

FrameBlock::~FrameBlock() { ::munmap(words_, bytes_); }

void FrameBlock::clear() noexcept {
    for (std::size_t i = 0; i < bytes_ / sizeof(Word); ++i)
        words_[i].store(0, std::memory_order_relaxed);
}

FrameMemory::FrameMemory() : fd_(::memfd_create("rtcf-frames", MFD_CLOEXEC)) {
    if (fd_ < 0) throw std::system_error(errno, std::generic_category(), "no memory for frames");
    static_assert(sizeof(Directory) <= kSmallest);
    try {
        directory_ = new (mapped(fd_, 0, kSmallest)) Directory{};
    } catch (...) {
        ::close(fd_);
        throw;
    }
    end_ = kSmallest;
    directory_->magic = kFramesMagic;
    directory_->version = kFramesVersion;
}

FrameMemory::~FrameMemory() {
    ::munmap(directory_, kSmallest);
    ::close(fd_);
}

std::shared_ptr<FrameBlock> FrameMemory::take(std::size_t bytes) {
    while (rings_.size() >= kRings && forgetOldest()) continue;
    if (rings_.size() >= kRings) return nullptr;
    return block(bytes);
}

std::shared_ptr<FrameBlock> FrameMemory::block(std::size_t bytes) {
    std::size_t size = kSmallest;
    while (size < bytes) size *= 2;
    do {
        const auto found = std::find_if(free_.begin(), free_.end(),
                                        [size](const auto& each) { return each->bytes() == size; });
        if (found != free_.end()) {
            std::shared_ptr<FrameBlock> again = std::move(*found);
            free_.erase(found);
            again->clear();
            return again;
        }
        if (bytes_ + size <= kMost) {
            std::shared_ptr<FrameBlock> made;
            try {
                made = std::make_shared<FrameBlock>(fd_, end_, size);
            } catch (const std::system_error&) {
                return nullptr;
            }
            end_ += size;
            bytes_ += size;
            return made;
        }
        if (free_.empty()) continue;
        // A free block of another size returns to the system. This happens as late as possible,
        // because unmapping interrupts the loop's CPU.
        const FrameBlock& gone = *free_.front();
        (void)::fallocate(fd_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE,
                          static_cast<off_t>(gone.offset()), static_cast<off_t>(gone.bytes()));
        bytes_ -= gone.bytes();
        free_.erase(free_.begin());
    } while (!free_.empty() || bytes_ + size <= kMost || forgetOldest());
    return nullptr;
}

void FrameMemory::announce(const std::shared_ptr<FrameBlock>& block, std::size_t frames,
                           std::size_t words_of_frame, const std::string& layout) {
    auto& entries = directory_->entries;
    auto* const unused = std::find_if(entries.begin(), entries.end(), [](const auto& entry) {
        return entry.sequence.load(std::memory_order_relaxed) == 0;
    });
    const std::shared_ptr<FrameBlock> text =
        unused == entries.end() ? nullptr : this->block(layout.size());
    if (text == nullptr) {
        // Without a directory entry or room for its layout, the ring cannot be read, but it
        // occupies memory while the loop fills it.
        rings_.push_back({block, nullptr, kRings});
        return;
    }
    std::memcpy(static_cast<void*>(text->words()), layout.data(), layout.size());
    unused->words_offset = block->offset();
    unused->frames = frames;
    unused->words_of_frame = words_of_frame;
    unused->layout_offset = text->offset();
    unused->layout_bytes = layout.size();
    unused->sequence.store(++sequence_, std::memory_order_release);
    rings_.push_back({block, text, static_cast<std::size_t>(unused - entries.begin())});
}

// Removes the oldest ring that is neither filled nor read.
// @return false if there is none
bool FrameMemory::forgetOldest() {
    const auto oldest = std::find_if(rings_.begin(), rings_.end(),
                                     [](const Ring& ring) { return ring.block.use_count() == 1; });
    if (oldest == rings_.end()) return false;
    free_.push_back(std::move(oldest->block));
    if (oldest->layout != nullptr) {
        directory_->entries[oldest->entry].sequence.store(0, std::memory_order_release);
        free_.push_back(std::move(oldest->layout));
    }
    rings_.erase(oldest);
    return true;
}

}  // namespace rtcf::executor
