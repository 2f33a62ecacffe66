/// @file
/// Everything that a runner has at a ROS master: topics in both directions, parameters, the log,
/// services and reports. Each is reconciled repeatedly with the wanted state, because a master may
/// have come or gone meanwhile.
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
#include "ros/transport/rejected_connections.hpp"

namespace rtcf::ros1 {

/// Owned by the master watch. Watch thread, unless stated otherwise.
class RosInterface {
   public:
    /// @param rosout opened and closed with the node; outlives this object
    /// @param log receives the reasons of rejected changes; outlives this object
    RosInterface(Rosout& rosout, executor::Log& log);

    /// @name Any thread; return at once
    /// @{
    void attach(executor::RunnerView& runner, const executor::AskSupervisor& ask);
    void configure(const executor::BridgeSettings& settings);
    void setTable(const executor::BridgeTable& table);
    void setClock(std::shared_ptr<executor::SimulatedClock> clock);
    void serveParameters(executor::ParameterRequest request);
    void noteParameterWritten(const std::string& key);
    /// Fills in its part of a status.
    void show(executor::BridgeStatus& status) const;
    bool feeds(const executor::Injector& injector) const { return subscribing_.feeds(injector); }
    /// Ends calls that wait for the loop.
    void end() { reconfiguring_.end(); }
    /// @}

    /// Removes closed topics that are no longer wanted.
    void tidy() { publishing_.tidy(); }
    /// Opens and closes topics as wanted. The node is up.
    Reconciled reconcile(MasterLink& link, const executor::BridgeSettings& settings);
    /// Does the part of reconcile() that needs no master.
    void reconcileWithoutMaster(MasterLink& link);
    /// Closes everything; reconcile() opens it again.
    /// @param deadline end of calls to the master
    void closeAll(MasterLink& link, MasterLink::Clock::time_point deadline);
    /// Releases the runner.
    void detach();
    /// Removes all taps, so that nothing is opened again.
    void drop() { publishing_.setTaps({}); }

    /// Rejected connections and values of parameters that have not been reported yet.
    std::vector<std::string> newRejections() {
        std::vector<std::string> lines = reconfiguring_.takeRejections();
        if (rejected_)
            for (std::string& line : rejected_->take()) lines.push_back(std::move(line));
        return lines;
    }
    /// A warning although everything is open: an unknown version of roscpp, a namespace of another
    /// node, or a rejected connection. Empty = none.
    std::string notice() const {
        if (!broken_.empty()) return broken_.front();
        if (!claim_.problem().empty()) return claim_.problem();
        return rejected_ ? rejected_->recent() : std::string();
    }

   private:
    Rosout& rosout_;
    executor::Log& log_;
    Publishing publishing_;
    Subscribing subscribing_;
    Reconfiguring reconfiguring_;
    std::mutex mutex_;                              // protects introspection_ until the first use
    std::unique_ptr<Introspection> introspection_;  // null without a runner
    const std::vector<std::string> broken_ = broken(dependences());
    Claim claim_;
    std::unique_ptr<RejectedConnections> rejected_;  // since the start of the node
    bool open_ = false;
};

}  // namespace rtcf::ros1
