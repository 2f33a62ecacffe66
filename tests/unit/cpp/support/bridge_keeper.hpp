/// @file
/// The test's end of the executor's bridge: holds the taps and injectors that
/// a graph offers, in place of the ROS node.
#pragma once

#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "bridge/bridge.hpp"

namespace rtcf::test {

/// What a bridge was given; shared by the bridge, which the runner owns, and the test.
class BridgeRecord {
   public:
    /// @return null if there is none of that topic
    std::shared_ptr<executor::Tap> tap(const std::string& topic) const;
    std::shared_ptr<executor::Injector> injector(const std::string& topic) const;
    void set(std::shared_ptr<const executor::BridgeTable> table);
    /// Taps of that topic that the bridge was given, ever.
    std::size_t everGiven(const std::string& topic) const;
    /// By which the test asks for a change of parameters, as ROS does.
    executor::ParameterRequest request;

   private:
    mutable std::mutex mutex_;
    std::shared_ptr<const executor::BridgeTable> table_ = std::make_shared<executor::BridgeTable>();
    std::set<std::shared_ptr<executor::Tap>> taps_;
};

class BridgeKeeper final : public executor::Bridge {
   public:
    explicit BridgeKeeper(std::shared_ptr<BridgeRecord> record) : record_(std::move(record)) {}
    void serveParameters(executor::ParameterRequest request) override {
        record_->request = std::move(request);
    }
    void configure(const executor::BridgeSettings&) override {}
    void setTable(std::shared_ptr<const executor::BridgeTable> table) override {
        record_->set(std::move(table));
    }
    void setClock(std::shared_ptr<executor::SimulatedClock>) override {}
    executor::BridgeStatus status() const override {
        executor::BridgeStatus status;
        status.simulated_time = false;
        return status;
    }

   private:
    std::shared_ptr<BridgeRecord> record_;
};

}  // namespace rtcf::test
