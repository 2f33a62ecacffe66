/// @file
/// Registration of this process's topics and services at the master. roscpp registers them one by
/// one, with its locks held, and only once. Here, roscpp's calls are only noted; a thread makes
/// many registrations in parallel, repeats them at a new master, and withdraws all of them at the
/// end, even those that roscpp has forgotten.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "ros/calls/master_client.hpp"

namespace rtcf::ros1 {

/// Owned by MasterCalls. Any thread; not real-time.
class Registrar {
   public:
    using Clock = std::chrono::steady_clock;
    /// Called by the registrar's thread with the publishers of a newly subscribed topic.
    using Connect =
        std::function<void(const std::string& topic, const XmlRpc::XmlRpcValue& publishers)>;

    explicit Registrar(Connect connect);
    ~Registrar();
    Registrar(const Registrar&) = delete;
    Registrar& operator=(const Registrar&) = delete;

    /// Notes a call of roscpp to its master.
    /// @return false if the call is not a registration
    bool note(const std::string& method, const XmlRpc::XmlRpcValue& arguments);

    /// Sets the address of the master.
    void useMaster(const MasterAddress& master);
    /// Repeats all registrations, because the master has lost them.
    void forget();
    /// Registers everything (true) or withdraws everything (false).
    void show(bool shown);
    /// Repeats calls without an answer, because the master answers again.
    void retry();

    /// Waits until all registrations are made.
    /// @return false if that takes longer than the deadline
    bool flush(Clock::time_point deadline);
    /// True if the master has confirmed any registration.
    bool hasRegistered() const;
    /// Withdraws everything and registers nothing more.
    /// @return number of registrations that the master may still have
    std::size_t withdraw(Clock::time_point deadline);

   private:
    enum class Registered { No, Maybe, Yes };
    // A registration of a published topic, a subscribed topic or a service.
    struct Entry {
        XmlRpc::XmlRpcValue arguments;  // arguments of the registration
        bool wanted = false;
        bool renewed = false;  // withdrawn and registered again: both go to the master
        Registered registered = Registered::No;
        std::uint64_t version = 0;  // number of registrations
    };
    using Key = std::pair<std::string, std::string>;  // kind, as in the method's name; name
    enum class Step { None, Register, Withdraw };
    struct Task {
        Key key;
        Step step;
        std::uint64_t version;
    };

    Step due(const Entry& entry) const;
    bool settled() const;
    std::vector<Task> tasks(std::vector<MasterCall>& calls);
    void apply(const Task& task, MasterAnswer& answer,
               std::vector<std::pair<std::string, XmlRpc::XmlRpcValue>>& connections);
    void run();

    const Connect connect_;
    std::atomic<bool> cancel_{false};
    mutable std::mutex mutex_;  // protects entries_ to deadline_
    std::condition_variable changed_;
    std::map<Key, Entry> entries_;
    MasterAddress master_;
    std::uint64_t master_version_ = 0;
    bool shown_ = true;
    bool silent_ = false;  // the master did not answer the last call
    bool calling_ = false;
    bool stop_ = false;
    Clock::time_point deadline_ = Clock::time_point::max();  // deadline of the last calls
    std::thread thread_;
};

}  // namespace rtcf::ros1
