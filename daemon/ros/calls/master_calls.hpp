/// @file
/// roscpp's own calls to its master, made here instead. roscpp waits for an
/// answer as long as it takes, and tells most of its callers nothing if none
/// comes: here each takes a second at most, and what got no answer is noted.
/// Registrations are not waited for at all: the registrar makes them.
/// ros::master::execute() of this program takes the place of the library's.
#pragma once

#include <xmlrpcpp/XmlRpcValue.h>

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>

#include "ros/calls/master_client.hpp"
#include "ros/calls/registrar.hpp"

namespace rtcf::ros1 {

/// All calls by way of roscpp, while it lives. One at a time in a process, as roscpp is. Any
/// thread; not real-time.
class MasterCalls {
   public:
    /// @param connect of the registrar
    explicit MasterCalls(Registrar::Connect connect);
    ~MasterCalls();
    MasterCalls(const MasterCalls&) = delete;
    MasterCalls& operator=(const MasterCalls&) = delete;

    /// The master to call, which knows nothing of us yet.
    void useMaster(const std::string& uri, const MasterAddress& address);
    /// The same master at another address.
    void moveTo(const MasterAddress& address);

    /// From now on no call gets an answer; those under way end within 50 ms. Registrations are
    /// noted all the same.
    void end() noexcept { ended_ = true; }

    /// What the master is told of topics and services.
    Registrar& registrar() noexcept { return registrar_; }

    /// @name Of the calling thread
    /// @{
    static void beginNote() noexcept;
    /// Waits until the master has been told of what was registered since beginNote().
    /// @return the first call since then that got no answer, one line; empty = none
    static std::string endNote() noexcept;
    /// @}

    /// Makes a call. @return false if it got no answer, or a refusal
    bool call(const std::string& method, const XmlRpc::XmlRpcValue& arguments,
              XmlRpc::XmlRpcValue& value);
    /// The one there is; null = none.
    static MasterCalls* current() noexcept;

   private:
    std::atomic<bool> ended_{false};
    std::atomic<std::int64_t> deaf_until_ms_{0};  // the master left a call without an answer
    struct Recent {
        MasterAnswer answer;
        std::int64_t at_ms;
    };
    mutable std::mutex mutex_;  // down to recent_
    std::string uri_;
    MasterAddress address_;
    std::map<std::string, Recent> recent_;  // what roscpp asks again and again
    Registrar registrar_;
};

}  // namespace rtcf::ros1
