/// @file
/// The component of this library whose hook the calling thread runs. RTT::log() needs it, as it has
/// no argument for the component.
#pragma once

#include <pthread.h>

#include <array>
#include <atomic>

#include "rtcf/component.hpp"

namespace rtcf::rtt_compat {

/// Entry of one thread that runs a hook.
struct HookSlot {
    std::atomic<pthread_t> thread{0};  ///< 0 = free
    const Component* component = nullptr;
};

/// More slots than threads that run hooks: the graph thread and the real-time thread.
__attribute__((visibility("hidden"))) inline std::array<HookSlot, 4> hook_slots;

/// The slot of the calling thread; null if it runs no hook. Real-time safe.
inline HookSlot* hookSlot() noexcept {
    for (HookSlot& slot : hook_slots) {
        if (slot.thread.load(std::memory_order_relaxed) == pthread_self()) return &slot;
    }
    return nullptr;
}

/// Marks the calling thread as running a hook, for the life of this object. It uses no lock, and no
/// thread_local, whose first use in a thread allocates. Real-time safe.
class InHook {
   public:
    /// @param component null during construction; the constructor of TaskContext sets it
    explicit InHook(const Component* component) noexcept {
        for (HookSlot& slot : hook_slots) {
            pthread_t free = 0;
            if (slot.thread.compare_exchange_strong(free, pthread_self(),
                                                    std::memory_order_acquire)) {
                slot.component = component;
                slot_ = &slot;
                return;
            }
        }
    }
    ~InHook() {
        if (slot_ != nullptr) slot_->thread.store(0, std::memory_order_release);
    }
    InHook(const InHook&) = delete;
    InHook& operator=(const InHook&) = delete;

   private:
    HookSlot* slot_ = nullptr;
};

}  // namespace rtcf::rtt_compat
