/// @file
/// Reports messages that are lost because they exceed the size limit: one line per connection, not
/// one per message.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "exchange/injector.hpp"
#include "exchange/serialized_tap.hpp"

namespace rtcf::executor {

/// Owned by FaultReports; graph thread only.
class SizeWatch {
   public:
    using Report = std::function<void(const std::string& line)>;

    /// @param runner name of the runner, for the advice
    SizeWatch(std::string runner, Report report)
        : runner_(std::move(runner)), report_(std::move(report)) {}

    /// Checks all connections of a plan; reports each at most once in ten seconds.
    /// @param largest present limit, bytes
    void look(const std::map<std::string, std::shared_ptr<SerializedTap>>& taps,
              const std::map<std::string, std::shared_ptr<Injector>>& injectors,
              std::size_t largest, std::int64_t now_ns);

    /// Number of messages lost so far.
    std::uint64_t total() const noexcept { return total_; }

   private:
    using Connection = std::weak_ptr<const void>;
    struct Known {
        std::uint64_t counted = 0;
        std::uint64_t reported = 0;
        std::int64_t next_report_ns = 0;
    };

    void note(const std::string& topic, const Connection& connection, std::uint64_t count,
              const char* what, std::size_t largest, std::int64_t now_ns);

    std::string runner_;
    Report report_;
    // Removed when the connection is destroyed. A connection that leaves a plan and returns keeps
    // its count.
    std::map<Connection, Known, std::owner_less<Connection>> known_;
    std::uint64_t total_ = 0;
};

}  // namespace rtcf::executor
