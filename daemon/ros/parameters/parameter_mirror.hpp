/// @file
/// Components' parameters at the master's parameter server, in step both ways: the values that hold
/// in the loop are written there, and what somebody else writes there is asked of the loop. What it
/// refuses is written over.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "bridge/bridge.hpp"
#include "ros/roscpp/master_client.hpp"

namespace rtcf::ros1 {

/// Owned by Reconfiguring. Watch thread, unless said otherwise.
class ParameterMirror {
   public:
    /// Our node, as the master knows it.
    struct Caller {
        std::string name;
        std::string uri;
    };

    /// By which changes are asked for. Before all else.
    void serve(executor::ParameterRequest request) { request_ = std::move(request); }

    /// The master says that a parameter or a namespace has been written. Any thread.
    void noteWritten(const std::string& key);

    /// Brings a component and the master in step. @return false if the master does not answer
    bool reconcile(MasterClient& master, const Caller& caller, const executor::ParameterSet& set);

    /// Minds a component no more. @return false if the master does not answer
    bool leave(MasterClient& master, const Caller& caller, const std::string& component);
    /// The same for all, as long as the master answers.
    void leaveAll(MasterClient& master, const Caller& caller);
    /// The master is another one, which knows nothing.
    void forget();

   private:
    using Values = std::map<std::string, ParameterValue>;  // by parameter
    // Components, by full name. Shared with answers that come late.
    struct Pending {
        std::mutex mutex;                // all below
        std::set<std::string> followed;  // the master tells of what is written
        std::set<std::string> written;   // of these, and not looked at yet
        std::set<std::string> asked;     // of the loop, and not answered yet
        std::set<std::string> refused;   // by the loop, and not written over yet
    };

    bool write(MasterClient& master, const Caller& caller, const executor::ParameterSet& set,
               Values& known) const;
    bool follow(MasterClient& master, const Caller& caller, const executor::ParameterSet& set,
                Values& known);
    bool read(MasterClient& master, const Caller& caller, const executor::ParameterSet& set,
              Values& known);
    void take(XmlRpc::XmlRpcValue& values, const executor::ParameterSet& set, Values& known);

    executor::ParameterRequest request_;
    std::map<std::string, Values> known_;  // what the master has, by component
    std::shared_ptr<Pending> pending_ = std::make_shared<Pending>();
};

}  // namespace rtcf::ros1
