#include "faults/flight_recorder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <new>
#include <system_error>
#include <utility>

#include "common/error.hpp"
#include "realtime/cycle_counter.hpp"

namespace rtcf::executor {

namespace {

constexpr std::uint32_t kMagic = 0x46435452;  // "RTCF"
constexpr std::uint32_t kVersion = 1;
constexpr off_t kLargest = 8 * 1024 * 1024;  // largest file, with the memory mappings of a crash

}  // namespace

const char* hookName(Hook hook) noexcept {
    switch (hook) {
        case Hook::Constructor:
            return "constructor";
        case Hook::Configure:
            return "configure";
        case Hook::Start:
            return "start";
        case Hook::Stop:
            return "stop";
        case Hook::Cleanup:
            return "cleanup";
        case Hook::Prepare:
            return "prepare";
        case Hook::Safe:
            return "safe";
        case Hook::TakeOver:
            return "takeOver";
        case Hook::Wait:
            return "wait";
        case Hook::Destructor:
            return "destructor";
        case Hook::None:
            break;
    }
    return "";
}

std::string RunningHook::name() const {
    return component.empty() ? std::string() : fmt::format("{}.{}", component, hookName(hook));
}

FlightRecorder::FlightRecorder() : fd_(::memfd_create("rtcf-flight-recorder", MFD_CLOEXEC)) {
    void* memory = MAP_FAILED;
    if (fd_ >= 0 && ::ftruncate(fd_, sizeof(Page)) == 0) {
        memory = ::mmap(nullptr, sizeof(Page), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE,
                        fd_, 0);
    }
    if (memory == MAP_FAILED) {
        const int error = errno;
        if (fd_ >= 0) ::close(fd_);
        throw std::system_error(error, std::generic_category(), "no flight recorder");
    }
    page_ = new (memory) Page{};
    page_->magic = kMagic;
    page_->version = kVersion;
    page_->slots = kSlots;
}

FlightRecorder::~FlightRecorder() {
    ::munmap(page_, sizeof(Page));
    ::close(fd_);
}

std::uint32_t FlightRecorder::addSlot(const std::string& name) {
    std::uint32_t slot = next_;
    if (!free_.empty()) {
        slot = free_.back();
        free_.pop_back();
    } else if (next_ < kSlots) {
        ++next_;
    } else {
        throw Error(ErrorKind::ResourceExhausted,
                    fmt::format("{}: a runner holds at most {} components; add another runner",
                                name, kSlots - 1));
    }
    auto& text = page_->names[slot];
    std::strncpy(text, name.c_str(), sizeof text - 1);
    text[sizeof text - 1] = '\0';
    return slot;
}

void FlightRecorder::removeSlot(std::uint32_t slot) noexcept {
    page_->names[slot][0] = '\0';
    free_.push_back(slot);
}

void FlightRecorder::enterHook(std::uint32_t slot, Hook hook) {
    noteGraph({static_cast<const char*>(page_->names[slot]), hook, slot});
}

void FlightRecorder::enterLibrary(const std::string& component) {
    noteGraph({component, Hook::Constructor, 0});
}

void FlightRecorder::leaveHook() noexcept { noteGraph({}); }

void FlightRecorder::noteGraph(RunningHook hook) noexcept {
    page_->graph_slot.store(hook.slot, std::memory_order_relaxed);
    page_->graph_hook.store(static_cast<std::uint32_t>(hook.slot == 0 ? Hook::None : hook.hook),
                            std::memory_order_relaxed);
    hook.since_ns = monotonicNow();
    const std::lock_guard<std::mutex> lock(mutex_);
    running_hook_ = std::move(hook);
}

RunningHook FlightRecorder::runningHook() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return running_hook_;
}

std::string FlightRecorder::realtimeActivity() const {
    const std::uint32_t slot = runningSlot();
    if (slot == 0) return {};
    const auto hook = static_cast<Hook>(page_->realtime_hook.load(std::memory_order_relaxed));
    return fmt::format("{}.{}", static_cast<const char*>(page_->names[slot]),
                       hook == Hook::None ? "update" : hookName(hook));
}

bool FlightRecorder::noteCrash(int signal, ThreadRole thread, CrashReason reason,
                               const void* address) noexcept {
    std::uint32_t none = 0;
    if (!page_->crash_signal.compare_exchange_strong(none, static_cast<std::uint32_t>(signal)))
        return false;
    page_->crash_thread.store(static_cast<std::uint32_t>(thread));
    page_->crash_reason.store(static_cast<std::uint32_t>(reason));
    page_->crash_address.store(reinterpret_cast<std::uintptr_t>(address));
    return true;
}

// Writes to the file after the page. That part of the file is empty before a crash, so it takes no
// locked memory.
void FlightRecorder::noteTrace(const void* const* frames, std::size_t count) const noexcept {
    constexpr off_t kFrames = sizeof(Page) + sizeof(std::uint64_t);
    off_t at = kFrames + static_cast<off_t>(kMostFrames * sizeof(std::uint64_t));
    const int maps = ::open("/proc/self/maps", O_RDONLY | O_CLOEXEC);
    if (maps < 0) return;
    std::array<char, 1024> buffer;  // NOLINT(cppcoreguidelines-pro-type-member-init): on a signal's
                                    // stack
    ssize_t taken = 0;
    while (at < kLargest && (taken = ::read(maps, buffer.data(), buffer.size())) > 0) {
        if (::pwrite(fd_, buffer.data(), static_cast<std::size_t>(taken), at) != taken) break;
        at += taken;
    }
    ::close(maps);
    count = std::min(count, kMostFrames);
    for (std::size_t i = 0; i < count; ++i) {
        const auto frame = reinterpret_cast<std::uintptr_t>(frames[i]);
        const auto place = kFrames + static_cast<off_t>(i * sizeof frame);
        if (::pwrite(fd_, &frame, sizeof frame, place) != sizeof frame) return;
    }
    // Written last, so that all counted frames are complete.
    const std::uint64_t counted = count;
    [[maybe_unused]] const ssize_t done =
        ::pwrite(fd_, &counted, sizeof counted, static_cast<off_t>(sizeof(Page)));
}

}  // namespace rtcf::executor
