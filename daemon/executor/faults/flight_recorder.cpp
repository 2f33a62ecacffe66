#include "faults/flight_recorder.hpp"

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <new>
#include <system_error>

#include "common/refusal.hpp"

namespace rtcf::executor {

namespace {

constexpr std::uint32_t kMagic = 0x46435452;  // "RTCF"
constexpr std::uint32_t kVersion = 1;

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
        case Hook::None:
            break;
    }
    return "";
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
        throw Refusal(RefusalKind::ResourceExhausted,
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

std::string FlightRecorder::realtimeActivity() const {
    const std::uint32_t slot = runningSlot();
    if (slot == 0) return {};
    const auto hook = static_cast<Hook>(page_->realtime_hook.load(std::memory_order_relaxed));
    return fmt::format("{}.{}", static_cast<const char*>(page_->names[slot]),
                       hook == Hook::None ? "update" : hookName(hook));
}

void FlightRecorder::noteCrash(int signal, ThreadRole thread, CrashReason reason,
                               const void* address) noexcept {
    std::uint32_t none = 0;
    if (!page_->crash_signal.compare_exchange_strong(none, static_cast<std::uint32_t>(signal)))
        return;
    page_->crash_thread.store(static_cast<std::uint32_t>(thread));
    page_->crash_reason.store(static_cast<std::uint32_t>(reason));
    page_->crash_address.store(reinterpret_cast<std::uintptr_t>(address));
}

}  // namespace rtcf::executor
