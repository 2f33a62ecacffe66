/// @file
/// Synchronises components' parameters with the master's parameter server: it writes the loop's
/// values there, and requests values written there by others from the loop. Rejected values are
/// overwritten. docs/ros.md lists which value wins in each case.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bridge/bridge.hpp"
#include "ros/calls/master_client.hpp"
#include "ros/roscpp/reconciled.hpp"

namespace rtcf::ros1 {

/// Owned by Reconfiguring. Watch thread, unless stated otherwise.
class ParameterMirror {
   public:
    /// This node's name and URI.
    struct Caller {
        std::string name;
        std::string uri;
    };
    /// A component. `is_new` = it was loaded after the node registered at this master, so its
    /// values are newer than the master's.
    struct Component {
        std::shared_ptr<const executor::ParameterSet> set;
        bool is_new = false;
    };

    /// Sets the function that requests changes. Called first.
    void serve(executor::ParameterRequest request) { request_ = std::move(request); }
    /// Sets whether values written at the master are requested from the loop, or overwritten.
    void follow(bool follows) { follows_ = follows; }

    /// Notes that a parameter or a namespace has been written. Any thread.
    void noteWritten(const std::string& key);

    /// Synchronises components and the master.
    Reconciled reconcile(ParallelCalls& master, const Caller& caller,
                         const std::vector<Component>& components);

    /// Removes components: deletes the values written for them, or restores earlier values of
    /// others.
    void leave(ParallelCalls& master, const Caller& caller, const std::set<std::string>& components,
               std::chrono::steady_clock::time_point deadline);
    /// Removes all components.
    void leaveAll(ParallelCalls& master, const Caller& caller,
                  std::chrono::steady_clock::time_point deadline);
    /// Starts again with a new master.
    void forget();

    /// Takes the rejections of values that no parameter can have, one line each. Others are
    /// rejected by the loop.
    std::vector<std::string> takeRejections() { return std::exchange(rejections_, {}); }

    /// A value that the parameter server cannot store, one line; empty = none. Any thread.
    std::string problem() const;

   private:
    // The known state of a component at the master.
    struct Known {
        std::map<std::string, ParameterValue> values;       // by parameter
        std::map<std::string, XmlRpc::XmlRpcValue> others;  // last values written by others
        std::set<std::string> ours;                         // parameters written by us
    };
    // Sets of components, by full name. Shared with callbacks, which may be called late.
    struct Pending {
        std::mutex mutex;                // protects all members below
        std::set<std::string> followed;  // the master reports writes
        std::set<std::string> written;   // written since the last read
        std::set<std::string> asked;     // with a pending request to the loop
        std::set<std::string> refused;   // values rejected by the loop, not overwritten yet
        std::string problem;
    };

    bool read(ParallelCalls& master, const Caller& caller, const std::vector<Component>& components,
              std::set<std::string>& asked, Reconciled& result);
    bool write(ParallelCalls& master, const Caller& caller,
               const std::vector<Component>& components, Reconciled& result);
    bool take(XmlRpc::XmlRpcValue& values, const Component& component, bool first);
    void ask(const std::string& component, executor::ParameterBatch batch);

    executor::ParameterRequest request_;
    bool follows_ = true;
    std::map<std::string, Known> known_;  // by component
    // Calls still to make for removed components, before calls for new components of the same
    // names.
    std::map<std::string, std::vector<MasterCall>> owed_;
    std::vector<std::string> rejections_;
    std::shared_ptr<Pending> pending_ = std::make_shared<Pending>();
};

}  // namespace rtcf::ros1
