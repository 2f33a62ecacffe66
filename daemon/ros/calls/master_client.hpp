/// @file
/// Calls with timeouts to a ROS master, or to any XML-RPC server with the same form of answers.
/// roscpp's own calls wait for an answer without limit.
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

/// Result of a call.
struct MasterAnswer {
    enum class Kind {
        Success,
        Refused,  ///< the answer is an error
        Silent,   ///< no answer
    };
    Kind kind = Kind::Silent;
    std::string message;        ///< message of the answer
    XmlRpc::XmlRpcValue value;  ///< value of the answer

    explicit operator bool() const { return kind == Kind::Success; }
    bool silent() const { return kind == Kind::Silent; }
    /// The value as a string; empty if it is not a string.
    std::string text();
};

/// Timeout of one answer of a master.
inline constexpr std::chrono::milliseconds kMasterAnswerTimeout{1000};

/// A method and an array of arguments.
struct MasterCall {
    std::string method;
    XmlRpc::XmlRpcValue arguments;
};

/// Makes an argument array of strings.
XmlRpc::XmlRpcValue texts(const std::vector<std::string>& arguments);

/// Numeric address of a server, because looking up a name may take longer than a call.
struct MasterAddress {
    std::string address;  ///< numeric
    std::uint32_t port = 0;
};

/// One connection to a server. One thread at a time; not real-time.
class MasterClient {
   public:
    using Clock = std::chrono::steady_clock;

    /// @param timeout timeout of one call
    /// @param cancel  when it becomes true, a call ends within 50 ms; outlives this object
    MasterClient(const MasterAddress& server, std::chrono::milliseconds timeout,
                 const std::atomic<bool>& cancel);

    /// Calls a method with an array of arguments.
    MasterAnswer call(const char* method, const XmlRpc::XmlRpcValue& arguments);

   private:
    XmlRpc::XmlRpcClient client_;
    std::chrono::milliseconds timeout_;
    const std::atomic<bool>& cancel_;
};

/// Parallel calls, each on its own connection, so that all together take as long as the slowest
/// answer. One thread at a time; not real-time.
class ParallelCalls {
   public:
    using Clock = std::chrono::steady_clock;

    /// @param cancel when it becomes true, calls end within 5 ms; outlives this object
    ParallelCalls(MasterAddress server, const std::atomic<bool>& cancel);
    ~ParallelCalls();
    ParallelCalls(const ParallelCalls&) = delete;
    ParallelCalls& operator=(const ParallelCalls&) = delete;

    /// Makes the calls.
    /// @param each     timeout of one answer; after a timeout, no more calls are begun
    /// @param deadline end of all calls
    /// @return the answers, in the order of the calls
    std::vector<MasterAnswer> run(const std::vector<MasterCall>& calls,
                                  std::chrono::milliseconds each, Clock::time_point deadline);

   private:
    struct Line;

    MasterAddress server_;
    const std::atomic<bool>& cancel_;
    std::vector<std::unique_ptr<Line>> lines_;
};

/// Splits a master's URI into host and port.
/// @return false if the URI is invalid
bool splitMasterUri(const std::string& uri, std::string& host, std::uint32_t& port);

}  // namespace rtcf::ros1
