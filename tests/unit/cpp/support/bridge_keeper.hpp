/// @file
/// The test's side of the executor's bridge: holds the taps and injectors of a
/// graph, in place of the ROS node.
#pragma once

#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "bridge/bridge.hpp"

namespace rtcf::test {

/// The objects given to a bridge; shared by the test and the bridge, which the runner owns.
class BridgeRecord {
   public:
    /// @return the tap of a topic, or null
    std::shared_ptr<executor::Tap> tap(const std::string& topic) const;
    std::shared_ptr<executor::Injector> injector(const std::string& topic) const;
    void set(std::shared_ptr<const executor::BridgeTable> table);
    /// The number of taps of that topic given to the bridge so far.
    std::size_t everGiven(const std::string& topic) const;
    /// Used by the test to request a change of parameters, as ROS does.
    executor::ParameterRequest request;
    executor::RunnerView* runner = nullptr;

   private:
    mutable std::mutex mutex_;
    std::shared_ptr<const executor::BridgeTable> table_ = std::make_shared<executor::BridgeTable>();
    std::set<std::shared_ptr<executor::Tap>> taps_;
};

class BridgeKeeper final : public executor::Bridge {
   public:
    explicit BridgeKeeper(std::shared_ptr<BridgeRecord> record) : record_(std::move(record)) {}
    void attach(executor::RunnerView& runner) override { record_->runner = &runner; }
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
