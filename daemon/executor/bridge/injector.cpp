#include "bridge/injector.hpp"

namespace rtcf::executor {

Injector::Injector(std::string topic, const TypeInfo& type)
    : topic_(std::move(topic)), type_(type) {
    for (auto& slot : slots_) slot = type_.make_slot(nullptr);
}

bool Injector::deliver(const std::uint8_t* bytes, std::uint32_t size) {
    if (size > largest_.load(std::memory_order_relaxed)) {
        too_large_.fetch_add(1, std::memory_order_relaxed);
        return false;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!queueing_) return store(bytes, size);
    waiting_.emplace_back(bytes, bytes + size);
    if (waiting_.size() <= kMaxWaiting) return true;
    waiting_.pop_front();
    refused_.fetch_add(1, std::memory_order_relaxed);
    return true;
}

void Injector::setQueueing(bool queueing) {
    const std::lock_guard<std::mutex> lock(mutex_);
    queueing_ = queueing;
    if (queueing) return;
    for (const auto& message : waiting_)
        store(message.data(), static_cast<std::uint32_t>(message.size()));
    waiting_.clear();
}

void Injector::deliverNext() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (waiting_.empty()) return;
    store(waiting_.front().data(), static_cast<std::uint32_t>(waiting_.front().size()));
    waiting_.pop_front();
}

bool Injector::store(const std::uint8_t* bytes, std::uint32_t size) {
    if (!type_.deserialize(*slots_[back_], bytes, size)) {
        refused_.fetch_add(1, std::memory_order_relaxed);
        return false;
    }
    back_ = middle_.exchange(back_ | kFresh, std::memory_order_acq_rel) & ~kFresh;
    delivered_.fetch_add(1, std::memory_order_relaxed);
    return true;
}

}  // namespace rtcf::executor
