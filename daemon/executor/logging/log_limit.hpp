/// @file
/// How much one call site may log: a component that logs in each cycle neither floods those who
/// read nor costs much. What is left out is counted, and the count is said.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <tuple>

#include "rtcf/logging.hpp"

namespace rtcf::executor {

/// Where a record comes from: a line of a component.
struct LogOrigin {
    std::string component;  ///< full name
    std::string file;
    std::uint32_t line = 0;
    LogLevel level = LogLevel::Info;

    bool operator<(const LogOrigin& other) const {
        return std::tie(component, file, line, level) <
               std::tie(other.component, other.file, other.line, other.level);
    }
};

/// Owned by the log, which locks it.
class LogLimit {
   public:
    /// @param count the origin's records that were left out
    using Report = std::function<void(const LogOrigin& origin, std::uint64_t count)>;

    /// Records of one origin in a second; 0 = any number.
    void set(std::uint32_t records) { limit_ = records; }

    /// @param time_ns of the record, on any clock, never much before the last one
    /// @return false if it is to be left out
    bool admit(const LogOrigin& origin, std::int64_t time_ns);

    /// Reports what was left out in seconds that are over.
    void report(std::int64_t now_ns, const Report& report);

   private:
    struct Second {
        std::int64_t begin_ns = 0;
        std::uint32_t admitted = 0;
        std::uint64_t left_out = 0;
    };

    std::uint32_t limit_ = 0;
    std::map<LogOrigin, Second> origins_;  // that have logged lately
};

}  // namespace rtcf::executor
