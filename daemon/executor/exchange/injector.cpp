#include "exchange/injector.hpp"

#include <utility>

namespace rtcf::executor {

Injector::Injector(std::string topic, const TypeInfo& type)
    : topic_(std::move(topic)), type_(type) {
    for (auto& slot : slots_) slot = type_.make_slot(nullptr);
    if (type_.fixed_size) fixed_size_ = static_cast<std::uint32_t>(type_.sample().size());
}

bool Injector::deliver(const std::uint8_t* bytes, std::uint32_t size, std::int64_t arrived_ns,
                       bool is_old) {
    if (!admits(size)) return false;
    const Arrival arrival{arrived_ns, is_old};
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!queueing_) return store(bytes, size, arrival, 0);
    while (!waiting_.empty() &&
           (waiting_.size() >= kMaxWaiting || waiting_bytes_ + size > kMaxWaitingBytes)) {
        dropOldest();
        passed_over_.fetch_add(1, std::memory_order_relaxed);
    }
    waiting_.push_back({arrival, {bytes, bytes + size}});
    waiting_bytes_ += size;
    return true;
}

bool Injector::admits(std::uint32_t size) {
    if (type_.fixed_size) {
        if (size <= fixed_size_) return true;
        refuse();
        return false;
    }
    if (size <= largest_.load(std::memory_order_relaxed)) return true;
    too_large_.fetch_add(1, std::memory_order_relaxed);
    return false;
}

void Injector::setQueueing(bool queueing) {
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        queueing_ = queueing;
    }
    if (!queueing) deliverUntil(INT64_MAX);
}

void Injector::deliverUntil(std::int64_t arrived_ns, double rate) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto ready = [&](std::size_t at) {
        return waiting_.size() > at && waiting_[at].arrival.time_ns <= arrived_ns;
    };
    if (backlogs_.empty()) {
        while (ready(1)) {
            dropOldest();
            passOver();
        }
    }
    while (ready(0)) {
        const auto& [arrival, bytes] = waiting_.front();
        const double age_ns = rate * static_cast<double>(arrived_ns - arrival.time_ns);
        store(bytes.data(), static_cast<std::uint32_t>(bytes.size()), arrival,
              static_cast<std::int64_t>(age_ns));
        dropOldest();
    }
}

void Injector::setAttention(std::shared_ptr<Attention> attention) {
    const std::lock_guard<std::mutex> lock(mutex_);
    attention_ = std::move(attention);
}

void Injector::setBacklogs(std::vector<std::shared_ptr<Backlog>> backlogs) {
    const std::lock_guard<std::mutex> lock(mutex_);
    backlogs_ = std::move(backlogs);
}

void Injector::dropOldest() {
    waiting_bytes_ -= waiting_.front().bytes.size();
    waiting_.pop_front();
}

void Injector::passOver() noexcept {
    if (backlogs_.empty()) passed_over_.fetch_add(1, std::memory_order_relaxed);
}

bool Injector::store(const std::uint8_t* bytes, std::uint32_t size, const Arrival& arrival,
                     std::int64_t age_ns) {
    if (!type_.deserialize(*slots_[back_], bytes, size)) {
        refused_.fetch_add(1, std::memory_order_relaxed);
        return false;
    }
    for (const auto& backlog : backlogs_)
        arrival.is_old ? backlog->refuse() : backlog->store(bytes, size, age_ns);
    slots_[back_]->stamp = age_ns;
    arrivals_[back_] = arrival;
    const std::uint32_t before = middle_.exchange(back_ | kFresh, std::memory_order_acq_rel);
    if (attention_ != nullptr) attention_->request(Attention::kArrived);
    if ((before & kFresh) != 0) passOver();
    back_ = before & ~kFresh;
    delivered_.fetch_add(1, std::memory_order_relaxed);
    fed_ = true;
    return true;
}

}  // namespace rtcf::executor
