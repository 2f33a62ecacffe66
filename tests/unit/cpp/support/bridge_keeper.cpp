#include "support/bridge_keeper.hpp"

#include <algorithm>

namespace rtcf::test {

std::shared_ptr<executor::Tap> BridgeRecord::tap(const std::string& topic) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& tap : table_->outputs) {
        if (tap->topic() == topic) return tap;
    }
    return nullptr;
}

std::shared_ptr<executor::Injector> BridgeRecord::injector(const std::string& topic) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& injector : table_->inputs) {
        if (injector->topic() == topic) return injector;
    }
    return nullptr;
}

void BridgeRecord::set(std::shared_ptr<const executor::BridgeTable> table) {
    const std::lock_guard<std::mutex> lock(mutex_);
    table_ = std::move(table);
    taps_.insert(table_->outputs.begin(), table_->outputs.end());
}

std::size_t BridgeRecord::everGiven(const std::string& topic) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto of_topic = [&topic](const auto& tap) { return tap->topic() == topic; };
    return static_cast<std::size_t>(std::count_if(taps_.begin(), taps_.end(), of_topic));
}

}  // namespace rtcf::test
