/// @file
/// roscpp's own calls to its master, made here instead. roscpp waits for an
/// answer as long as it takes, and tells most of its callers nothing if none
/// comes: here each takes a second at most, and what got no answer is noted.
/// ros::master::execute() of this program takes the place of the library's.
#pragma once

#include <xmlrpcpp/XmlRpcValue.h>

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>

namespace rtcf::ros1 {

/// All calls by way of roscpp, while it lives. One at a time in a process, as roscpp is. Any
/// thread; not real-time.
class MasterCalls {
   public:
    MasterCalls();
    ~MasterCalls();
    MasterCalls(const MasterCalls&) = delete;
    MasterCalls& operator=(const MasterCalls&) = delete;

    /// The master to call. @throws std::invalid_argument if the URI is none
    void useMaster(const std::string& uri);

    /// From now on no call gets an answer; those under way end within 50 ms.
    void end() noexcept { ended_ = true; }

    /// Services that this process has advertised, and their URIs, whether the master knows or not.
    std::map<std::string, std::string> services() const;

    /// True once after a registration that the master may not have got.
    bool takeMissed() noexcept { return missed_.exchange(false); }

    /// @name Of the calling thread
    /// @{
    static void beginNote() noexcept;
    /// @return the first call since beginNote() that got no answer, one line; empty = none
    static std::string endNote() noexcept;
    /// @}

    /// Makes a call. @return false if it got no answer, or a refusal
    bool call(const std::string& method, const XmlRpc::XmlRpcValue& arguments,
              XmlRpc::XmlRpcValue& value);
    /// The one there is; null = none.
    static MasterCalls* current() noexcept;

   private:
    void noteService(const std::string& method, const XmlRpc::XmlRpcValue& arguments);

    std::atomic<bool> ended_{false};
    std::atomic<bool> missed_{false};
    std::atomic<std::int64_t> deaf_until_ms_{0};  // the master left a call without an answer
    mutable std::mutex mutex_;                    // down to services_
    std::string uri_;
    std::string host_;
    std::uint32_t port_ = 0;
    std::map<std::string, std::string> services_;
};

}  // namespace rtcf::ros1
