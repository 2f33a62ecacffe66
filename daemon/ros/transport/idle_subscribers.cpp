#include "ros/transport/idle_subscribers.hpp"

#include <utility>
#include <vector>

#include "realtime/unlocked_memory.hpp"

namespace rtcf::ros1 {

IdleSubscribers& IdleSubscribers::ofProcess() {
    static auto& all =
        *new IdleSubscribers;  // NOLINT(cppcoreguidelines-owning-memory): for roscpp's threads
    return all;
}

bool IdleSubscribers::scarce() {
    using executor::UnlockedMemory;
    return UnlockedMemory::ofProcess().used() > UnlockedMemory::kMost / 2;
}

void IdleSubscribers::note(const ros::SubscriberLinkPtr& link, const void* before,
                           const void* after) {
    const auto now = Clock::now();
    const std::lock_guard lock(mutex_);
    if (after == nullptr) {
        queues_.erase(link.get());
        return;
    }
    Queue& queue = queues_[link.get()];
    // The address may belong to an earlier link.
    if (queue.oldest != before || queue.link.lock() != link) queue = {link, after, now, now};
    queue.oldest = after;
    queue.until = now;
}

std::size_t IdleSubscribers::disconnect() {
    constexpr auto kPatience = std::chrono::seconds(1);
    std::vector<ros::SubscriberLinkPtr> idle;
    {
        const std::lock_guard lock(mutex_);
        if (queues_.empty()) return 0;
        const std::size_t used = executor::UnlockedMemory::ofProcess().used();
        if (!scarce()) queues_.clear();
        // If no memory is left, there are no new messages to detect idle subscribers by.
        const bool none_left = used > executor::UnlockedMemory::kMost / 16 * 15;
        const auto now = Clock::now();
        for (auto each = queues_.begin(); each != queues_.end();) {
            const Queue& queue = each->second;
            const bool due = (none_left ? now : queue.until) - queue.since >= kPatience;
            if (due) {
                if (auto link = queue.link.lock()) idle.push_back(std::move(link));
            }
            each = due ? queues_.erase(each) : std::next(each);
        }
    }
    for (const auto& link : idle) link->drop();
    return idle.size();
}

}  // namespace rtcf::ros1
