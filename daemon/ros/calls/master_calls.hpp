/// @file
/// Replacement of roscpp's calls to its master. roscpp waits for an answer without limit, and does
/// not report a missing answer to most callers. Here, a call takes one second at most, and calls
/// without an answer are noted. Registrations do not wait at all: the registrar makes them. The
/// function ros::master::execute() of this program replaces that of the library.
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

/// Handles all of roscpp's calls to the master during its life. One object per process, like
/// roscpp. Any thread; not real-time.
class MasterCalls {
   public:
    /// @param connect passed to the registrar
    explicit MasterCalls(Registrar::Connect connect);
    ~MasterCalls();
    MasterCalls(const MasterCalls&) = delete;
    MasterCalls& operator=(const MasterCalls&) = delete;

    /// Sets a new master, at which nothing is registered yet.
    void useMaster(const std::string& uri, const MasterAddress& address);
    /// Changes the address of the same master.
    void moveTo(const MasterAddress& address);

    /// Fails all calls from now on; present ones end within 50 ms. Registrations are still noted.
    void end() noexcept { ended_ = true; }

    /// The registrations at the master.
    Registrar& registrar() noexcept { return registrar_; }

    /// @name Calls of the calling thread
    /// @{
    /// Begins to note calls without an answer.
    static void beginNote() noexcept;
    /// Waits until the master has the registrations made since beginNote().
    /// @return the first call since then without an answer, one line; empty = none
    static std::string endNote() noexcept;
    /// @}

    /// Makes a call.
    /// @return false if it got no answer, or an error
    bool call(const std::string& method, const XmlRpc::XmlRpcValue& arguments,
              XmlRpc::XmlRpcValue& value);
    /// The object of this process; null = none.
    static MasterCalls* current() noexcept;

   private:
    std::atomic<bool> ended_{false};
    std::atomic<std::int64_t> deaf_until_ms_{0};  // no calls before this time, after a timeout
    struct Recent {
        MasterAnswer answer;
        std::int64_t at_ms;
    };
    mutable std::mutex mutex_;  // protects uri_ to recent_
    std::string uri_;
    MasterAddress address_;
    std::map<std::string, Recent> recent_;  // answers to repeated calls of roscpp
    Registrar registrar_;
};

}  // namespace rtcf::ros1
