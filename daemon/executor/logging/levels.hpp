/// @file
/// Which records are wanted: a level for each logger that was given one, the
/// nearest ancestor's for the others. A component's logger is
/// `ros.rtcf.<name>`, with dots where its full name has slashes; what it logs
/// follows a change at once, in the cycle too.
#pragma once

#include <atomic>
#include <map>
#include <mutex>
#include <set>
#include <string>

#include "rtcf/logging.hpp"

namespace rtcf::executor {

/// Owned by the Log. Any thread that is not real-time.
class LogLevels {
   public:
    LogLevels();

    /// The logger of a component, by its full name; of the executor, if that is empty.
    static std::string loggerOf(const std::string& component);

    LogLevel of(const std::string& logger) const;
    void set(const std::string& logger, LogLevel level);
    /// The lowest level that any component logs at.
    LogLevel lowest() const;
    /// All loggers that have been named so far, components' included, and their levels.
    std::map<std::string, LogLevel> all() const;
    /// Names a logger, so that all() tells of it.
    void know(const std::string& logger);

    /// @name A component's level, kept up to date from attach() to detach()
    /// @{
    void attach(const std::string& component, std::atomic<LogLevel>& level);
    void detach(const std::atomic<LogLevel>& level);
    /// @}

   private:
    LogLevel find(const std::string& logger) const;  // with the lock

    mutable std::mutex mutex_;  // all below
    std::map<std::string, LogLevel> set_;
    std::set<std::string> known_;
    struct Attached {
        std::string logger;
        std::atomic<LogLevel>* level;
    };
    std::map<const std::atomic<LogLevel>*, Attached> attached_;
};

}  // namespace rtcf::executor
