/// @file
/// Calls to a ROS master, or to any XML-RPC server that answers in its manner,
/// that never take longer than they are allowed. roscpp's own calls wait for
/// an answer as long as it takes.
#pragma once

#include <xmlrpcpp/XmlRpcClient.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>

namespace rtcf::ros1 {

/// What came of a call.
struct MasterAnswer {
    enum class Kind {
        Success,
        Refused,  ///< answered that it will not or cannot
        Silent,   ///< no answer
    };
    Kind kind = Kind::Silent;
    std::string message;        ///< of the answer
    XmlRpc::XmlRpcValue value;  ///< of the answer

    explicit operator bool() const { return kind == Kind::Success; }
    bool silent() const { return kind == Kind::Silent; }
    /// The value as a string; empty if it is none.
    std::string text();
};

/// One connection to a server. One thread at a time; not real-time.
class MasterClient {
   public:
    /// @param timeout for one call
    /// @param cancel  if it becomes true, the call ends within 50 ms; must outlive this
    MasterClient(const std::string& host, std::uint32_t port, std::chrono::milliseconds timeout,
                 const std::atomic<bool>& cancel);

    /// Calls a method with an array of arguments.
    MasterAnswer call(const char* method, const XmlRpc::XmlRpcValue& arguments);

   private:
    XmlRpc::XmlRpcClient client_;
    std::chrono::milliseconds timeout_;
    const std::atomic<bool>& cancel_;
};

/// Host and port of a master's URI. @return false if it is none
bool splitMasterUri(const std::string& uri, std::string& host, std::uint32_t& port);

}  // namespace rtcf::ros1
