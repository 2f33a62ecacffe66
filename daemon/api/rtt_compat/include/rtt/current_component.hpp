/// @file
/// Which component of this library a thread runs a hook of, as RTT::log() does not say.
#pragma once

#include <pthread.h>

#include <array>
#include <atomic>

#include "rtcf/component.hpp"

namespace rtcf::rtt_compat {

/// Of one thread that is in a hook.
struct HookSlot {
    std::atomic<pthread_t> thread{0};  ///< 0: free
    const Component* component = nullptr;
};

/// More than a loop has threads with hooks in them: the graph thread and the real-time one.
__attribute__((visibility("hidden"))) inline std::array<HookSlot, 4> hook_slots;

/// The slot of this thread; null if it is in no hook. Real-time safe.
inline HookSlot* hookSlot() noexcept {
    for (HookSlot& slot : hook_slots) {
        if (slot.thread.load(std::memory_order_relaxed) == pthread_self()) return &slot;
    }
    return nullptr;
}

/// Says that this thread runs a hook, as long as it lives. No lock, and no thread_local, whose
/// first use in a thread allocates. Real-time safe.
class InHook {
   public:
    /// @param component null in its constructor, where TaskContext fills it in
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
