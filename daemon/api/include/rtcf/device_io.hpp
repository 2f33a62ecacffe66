/// @file
/// Device input and output in the cycle: the only place where a component may make system calls.
///
///     void update() override {
///         RTCF_DEVICE_IO(this);
///         ::write(bus_, &frame_, sizeof frame_);
///     }
#pragma once

#include <atomic>
#include <cstdint>
#include <ctime>

#include "rtcf/component.hpp"

// Functions of the RealtimeSanitizer's run time; only the executor of `rtcfctl check` has them.
extern "C" {
__attribute__((weak)) void __rtsan_disable();  // NOLINT: the name is clang's
__attribute__((weak)) void __rtsan_enable();   // NOLINT
}

namespace rtcf {

/// A scope in which `rtcfctl check` allows system calls, and whose time `rtcfctl stats` shows. The
/// class itself is real-time safe; the component must bound the time of the calls in the scope.
class DeviceIo {
   public:
    explicit DeviceIo(Component* component) noexcept
        : statistics_(accessTo(*component).context().device), begin_ns_(now()) {
        if (__rtsan_disable != nullptr) __rtsan_disable();
    }
    ~DeviceIo() {
        if (__rtsan_enable != nullptr) __rtsan_enable();
        if (statistics_ == nullptr) return;
        const auto relaxed = std::memory_order_relaxed;
        statistics_->calls.store(statistics_->calls.load(relaxed) + 1, relaxed);
        statistics_->time_ns.store(statistics_->time_ns.load(relaxed) + now() - begin_ns_, relaxed);
    }
    DeviceIo(const DeviceIo&) = delete;
    DeviceIo& operator=(const DeviceIo&) = delete;

   private:
    static std::int64_t now() noexcept {
        timespec time{};
        clock_gettime(CLOCK_MONOTONIC, &time);
        return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
    }

    DeviceStatistics* statistics_;  // null outside an executor
    std::int64_t begin_ns_;
};

}  // namespace rtcf

/// Marks the rest of the scope as device input and output of the component `self`.
#define RTCF_DEVICE_IO(self) const ::rtcf::DeviceIo rtcf_device_io(self)
