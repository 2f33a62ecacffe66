#include "support/bridge_keeper.hpp"

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
}

}  // namespace rtcf::test
