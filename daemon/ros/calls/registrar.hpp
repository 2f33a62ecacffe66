/// @file
/// What the master is told of this process's topics and services. roscpp would tell it itself, one
/// by one and with its locks held, once: here its calls are noted, and a thread tells the master as
/// many at a time as it takes, again when the master is another one, and takes back all of it at
/// the end, whether roscpp still knows of it or not.
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
    /// Called by its thread with the publishers that the master knows of a topic that this
    /// process has subscribed.
    using Connect =
        std::function<void(const std::string& topic, const XmlRpc::XmlRpcValue& publishers)>;

    explicit Registrar(Connect connect);
    ~Registrar();
    Registrar(const Registrar&) = delete;
    Registrar& operator=(const Registrar&) = delete;

    /// A call of roscpp's to its master. @return false if it is no registration
    bool note(const std::string& method, const XmlRpc::XmlRpcValue& arguments);

    /// Where the master is to be told from now on.
    void useMaster(const MasterAddress& master);
    /// The master has lost what it was told.
    void forget();
    /// Whether the master is to know of us; if not, all is taken back.
    void show(bool shown);
    /// The master answers: what it gave no answer to is told again.
    void retry();

    /// Waits until the master has been told all. @return false if it was not, in time
    bool flush(Clock::time_point deadline);
    /// True if the master has been told anything, as far as we know.
    bool hasTold() const;
    /// Takes all back, and tells nothing more. @return how many the master may still have
    std::size_t withdraw(Clock::time_point deadline);

   private:
    enum class Told { No, Maybe, Yes };
    // Of a topic that is published or subscribed, or a service.
    struct Entry {
        XmlRpc::XmlRpcValue arguments;  // of the registration
        bool wanted = false;
        bool renewed = false;  // taken back and registered again: the master is to hear of both
        Told told = Told::No;
        std::uint64_t version = 0;  // counts registrations
    };
    using Key = std::pair<std::string, std::string>;  // what it is, as in the method's name; name
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
    mutable std::mutex mutex_;  // down to deadline_
    std::condition_variable changed_;
    std::map<Key, Entry> entries_;
    MasterAddress master_;
    std::uint64_t master_version_ = 0;
    bool shown_ = true;
    bool silent_ = false;  // the master, when it was told last
    bool telling_ = false;
    bool stop_ = false;
    Clock::time_point deadline_ = Clock::time_point::max();  // of the last calls
    std::thread thread_;
};

}  // namespace rtcf::ros1
