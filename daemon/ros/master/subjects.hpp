/// @file
/// All that a runner has at a ROS master once it has a node there: topics in both directions,
/// parameters, the log, services and reports. Each is brought to what is wanted again and again,
/// as a master may have come or gone meanwhile.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "bridge/bridge.hpp"
#include "bridge/outside_call.hpp"
#include "ros/logging/rosout.hpp"
#include "ros/master/claim.hpp"
#include "ros/master/master_link.hpp"
#include "ros/reconfigure/reconfiguring.hpp"
#include "ros/roscpp/reconciled.hpp"
#include "ros/roscpp/replacements.hpp"
#include "ros/runner/introspection.hpp"
#include "ros/topics/publishing.hpp"
#include "ros/topics/subscribing.hpp"
#include "ros/transport/refusals.hpp"

namespace rtcf::ros1 {

/// Owned by the master watch; its thread, unless said otherwise.
class Subjects {
   public:
    /// @param rosout opened and closed with the node; outlives this
    /// @param log gets why changes were refused; outlives this
    Subjects(Rosout& rosout, executor::Log& log);

    /// @name Any thread; return at once
    /// @{
    void attach(executor::RunnerView& runner, const executor::AskSupervisor& ask);
    void configure(const executor::BridgeSettings& settings);
    void setTable(const executor::BridgeTable& table);
    void setClock(std::shared_ptr<executor::SimulatedClock> clock);
    void serveParameters(executor::ParameterRequest request);
    void noteParameterWritten(const std::string& key);
    /// Fills in what it knows.
    void show(executor::BridgeStatus& status) const;
    bool feeds(const executor::Injector& injector) const { return subscribing_.feeds(injector); }
    /// Calls that wait for the loop end now.
    void end() { reconfiguring_.end(); }
    /// @}

    /// Forgets closed topics that are not wanted any more.
    void tidy() { publishing_.tidy(); }
    /// Opens and closes topics until they are as wanted. The node is up.
    Reconciled reconcile(MasterLink& link, const executor::BridgeSettings& settings);
    /// What can be done without a master.
    void reconcileWithoutMaster(MasterLink& link);
    /// Closes all; reconcile() opens it again.
    /// @param deadline of what is said to the master
    void closeAll(MasterLink& link, MasterLink::Clock::time_point deadline);
    /// The runner is not looked at any more.
    void detach();
    /// Nothing is to be opened any more.
    void drop() { publishing_.setTaps({}); }

    /// Connections that were refused, which have not been told yet.
    std::vector<std::string> refusals() {
        return refusals_ ? refusals_->take() : std::vector<std::string>();
    }
    /// What is to be said although all is open: a roscpp that is not as we know it, a name that is
    /// another's, a connection that was refused. Empty = nothing.
    std::string notice() const {
        if (!broken_.empty()) return broken_.front();
        if (!claim_.problem().empty()) return claim_.problem();
        return refusals_ ? refusals_->recent() : std::string();
    }

   private:
    Rosout& rosout_;
    executor::Log& log_;
    Publishing publishing_;
    Subscribing subscribing_;
    Reconfiguring reconfiguring_;
    std::mutex mutex_;                              // introspection_, until it is taken
    std::unique_ptr<Introspection> introspection_;  // null without a runner
    const std::vector<std::string> broken_ = broken(dependences());
    Claim claim_;
    std::unique_ptr<Refusals> refusals_;  // since the node is up
    bool open_ = false;
};

}  // namespace rtcf::ros1
