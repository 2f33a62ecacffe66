/// @file
/// Components' parameters at the master's parameter server, in step both ways: the values that hold
/// in the loop are written there, and what somebody else writes there is asked of the loop. What it
/// refuses is written over. Which of two wins, docs/ros.md says row by row.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "bridge/bridge.hpp"
#include "ros/calls/master_client.hpp"
#include "ros/roscpp/reconciled.hpp"

namespace rtcf::ros1 {

/// Owned by Reconfiguring. Watch thread, unless said otherwise.
class ParameterMirror {
   public:
    /// Our node, as the master knows it.
    struct Caller {
        std::string name;
        std::string uri;
    };
    /// A component, and whether it came while this master was there: what it was given then is
    /// newer than what the master has.
    struct Component {
        std::shared_ptr<const executor::ParameterSet> set;
        bool is_new = false;
    };

    /// By which changes are asked for. Before all else.
    void serve(executor::ParameterRequest request) { request_ = std::move(request); }
    /// Whether what is written at the master is asked of the loop. Else it is written over.
    void follow(bool follows) { follows_ = follows; }

    /// The master says that a parameter or a namespace has been written. Any thread.
    void noteWritten(const std::string& key);

    /// Brings components and the master in step.
    Reconciled reconcile(ParallelCalls& master, const Caller& caller,
                         const std::vector<Component>& components);

    /// Minds components no more: what was written for them is taken back, or, where somebody else
    /// had put a value before, that is put back.
    void leave(ParallelCalls& master, const Caller& caller, const std::set<std::string>& components,
               std::chrono::steady_clock::time_point deadline);
    /// The same for all.
    void leaveAll(ParallelCalls& master, const Caller& caller,
                  std::chrono::steady_clock::time_point deadline);
    /// The master is another one, which knows nothing.
    void forget();

    /// A value that the parameter server cannot have, one line; empty = none. Any thread.
    std::string problem() const;

   private:
    // What the master has of a component, as far as we know.
    struct Known {
        std::map<std::string, ParameterValue> values;       // by parameter
        std::map<std::string, XmlRpc::XmlRpcValue> others;  // what others had put there, at last
        std::set<std::string> ours;  // parameters whose value we have written
    };
    // Components, by full name. Shared with answers that come late.
    struct Pending {
        std::mutex mutex;                // all below
        std::set<std::string> followed;  // the master tells of what is written
        std::set<std::string> written;   // of these, and not looked at yet
        std::set<std::string> asked;     // of the loop, and not answered yet
        std::set<std::string> refused;   // by the loop, and not written over yet
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
    // What the master is still to be told of components that left, before anything of others of
    // their names.
    std::map<std::string, std::vector<MasterCall>> owed_;
    std::shared_ptr<Pending> pending_ = std::make_shared<Pending>();
};

}  // namespace rtcf::ros1
