/// @file
/// Log levels of loggers. A logger without its own level has that of its nearest ancestor. A
/// component's logger is `ros.rtcf.<name>`, with dots for the slashes of its full name. A change
/// takes effect at once, also in the cycle.
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

    /// The logger of a component, by its full name; the executor's logger if it is empty.
    static std::string loggerOf(const std::string& component);

    LogLevel of(const std::string& logger) const;
    void set(const std::string& logger, LogLevel level);
    /// The least severe level of all components.
    LogLevel lowest() const;
    /// All known loggers, including those of components, and their levels.
    std::map<std::string, LogLevel> all() const;
    /// Adds a logger to those that all() returns.
    void know(const std::string& logger);

    /// @name A component's level, updated from attach() to detach()
    /// @{
    void attach(const std::string& component, std::atomic<LogLevel>& level);
    void detach(const std::atomic<LogLevel>& level);
    /// @}

   private:
    LogLevel find(const std::string& logger) const;  // mutex_ is held

    mutable std::mutex mutex_;  // protects all members below
    std::map<std::string, LogLevel> set_;
    std::set<std::string> known_;
    struct Attached {
        std::string logger;
        std::atomic<LogLevel>* level;
    };
    std::map<const std::atomic<LogLevel>*, Attached> attached_;
};

}  // namespace rtcf::executor
