/// @file
/// Limit of the records per source line, so that a component that logs in each cycle neither floods
/// readers nor costs much. Suppressed records are counted and reported.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <tuple>

#include "rtcf/logging.hpp"

namespace rtcf::executor {

/// Source of a record: a line of a component.
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

/// Owned by the log, which locks a mutex around each call.
class LogLimit {
   public:
    /// @param count number of suppressed records of the origin
    using Report = std::function<void(const LogOrigin& origin, std::uint64_t count)>;

    /// Sets the most records of one origin per second; 0 = no limit.
    void set(std::uint32_t records) { limit_ = records; }

    /// @param time_ns time of the record, on any clock; never much before the last one
    /// @return false if the record is to be suppressed
    bool admit(const LogOrigin& origin, std::int64_t time_ns);

    /// Reports the suppressed records of past seconds.
    void report(std::int64_t now_ns, const Report& report);

   private:
    struct Second {
        std::int64_t begin_ns = 0;
        std::uint32_t admitted = 0;
        std::uint64_t left_out = 0;
    };

    std::uint32_t limit_ = 0;
    std::map<LogOrigin, Second> origins_;  // origins with records in the last second
};

}  // namespace rtcf::executor
