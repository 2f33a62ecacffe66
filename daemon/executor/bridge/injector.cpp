#include "bridge/injector.hpp"

namespace rtcf::executor {

Injector::Injector(std::string topic, const TypeInfo& type)
    : topic_(std::move(topic)), type_(type) {
    for (auto& slot : slots_) slot = type_.make_slot(nullptr);
}

bool Injector::deliver(const std::uint8_t* bytes, std::uint32_t size) {
    if (!type_.deserialize(*slots_[back_], bytes, size)) {
        refused_.fetch_add(1, std::memory_order_relaxed);
        return false;
    }
    back_ = middle_.exchange(back_ | kFresh, std::memory_order_acq_rel) & ~kFresh;
    delivered_.fetch_add(1, std::memory_order_relaxed);
    return true;
}

}  // namespace rtcf::executor
