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
#include <memory>
#include <optional>
#include <string>
#include <vector>

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

/// For one answer of a master.
inline constexpr std::chrono::milliseconds kMasterAnswerTimeout{1000};

/// A method and an array of arguments.
struct MasterCall {
    std::string method;
    XmlRpc::XmlRpcValue arguments;
};

/// Arguments that are all texts.
XmlRpc::XmlRpcValue texts(const std::vector<std::string>& arguments);

/// Where a server is: an address, as looking up a name may take longer than any call.
struct MasterAddress {
    std::string address;  ///< numeric
    std::uint32_t port = 0;
};

/// One connection to a server. One thread at a time; not real-time.
class MasterClient {
   public:
    using Clock = std::chrono::steady_clock;

    /// @param timeout for one call
    /// @param cancel  if it becomes true, the call ends within 50 ms; must outlive this
    MasterClient(const MasterAddress& server, std::chrono::milliseconds timeout,
                 const std::atomic<bool>& cancel);

    /// Calls a method with an array of arguments.
    MasterAnswer call(const char* method, const XmlRpc::XmlRpcValue& arguments);

   private:
    XmlRpc::XmlRpcClient client_;
    std::chrono::milliseconds timeout_;
    const std::atomic<bool>& cancel_;
};

/// Several calls at a time, each over a connection of its own: what one answer takes, all take.
/// One thread at a time; not real-time.
class ParallelCalls {
   public:
    using Clock = std::chrono::steady_clock;

    /// @param cancel if it becomes true, calls end within 5 ms; must outlive this
    ParallelCalls(MasterAddress server, const std::atomic<bool>& cancel);
    ~ParallelCalls();
    ParallelCalls(const ParallelCalls&) = delete;
    ParallelCalls& operator=(const ParallelCalls&) = delete;

    /// @param each     how long one answer may take; after one that took longer none is asked for
    /// @param deadline of all
    /// @return the answers in the order of the calls
    std::vector<MasterAnswer> run(const std::vector<MasterCall>& calls,
                                  std::chrono::milliseconds each, Clock::time_point deadline);

   private:
    struct Line;

    MasterAddress server_;
    const std::atomic<bool>& cancel_;
    std::vector<std::unique_ptr<Line>> lines_;
};

/// Host and port of a master's URI. @return false if it is none
bool splitMasterUri(const std::string& uri, std::string& host, std::uint32_t& port);

}  // namespace rtcf::ros1
