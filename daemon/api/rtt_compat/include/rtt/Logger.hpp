/// @file
/// OROCOS' logger. In a hook, a line goes to the component's log; it is real-time safe if
/// formatting its arguments is. In threads that run no hook, it goes to stderr.
///     RTT::log(RTT::Warning) << "force " << force << " N" << RTT::endlog();
#pragma once

#include <array>
#include <cstdio>
#include <ostream>
#include <string>

#include "rtcf/log_buffer.hpp"
#include "rtt/current_component.hpp"

namespace RTT {

enum LoggerLevel { Never = 0, Fatal, Critical, Error, Warning, Info, Debug, RealTime };

namespace detail {

struct EndOfLine {};

constexpr rtcf::LogSite logSite(rtcf::LogLevel level) { return {level, "", 0, "RTT::log", "{}"}; }
/// Indexed by LoggerLevel.
inline constexpr std::array<rtcf::LogSite, 8> kLogSites{
    logSite(rtcf::LogLevel::Debug), logSite(rtcf::LogLevel::Fatal), logSite(rtcf::LogLevel::Fatal),
    logSite(rtcf::LogLevel::Error), logSite(rtcf::LogLevel::Warn),  logSite(rtcf::LogLevel::Info),
    logSite(rtcf::LogLevel::Debug), logSite(rtcf::LogLevel::Debug)};

/// Stream for one line; the destructor logs it.
class LogLine {
   public:
    explicit LogLine(LoggerLevel level) noexcept : level_(level), stream_(&buffer_) {}
    ~LogLine() {
        const std::string_view text = buffer_.text();
        if (level_ == Never || text.empty()) return;
        const rtcf::rtt_compat::HookSlot* const slot = rtcf::rtt_compat::hookSlot();
        if (slot == nullptr || slot->component == nullptr) {
            std::fprintf(stderr, "%.*s\n", static_cast<int>(text.size()), text.data());
            return;
        }
        const rtcf::LogSite& site = kLogSites[level_];
        if (slot->component->logs(site.level)) rtcf::rtt_compat::log(*slot->component, site, text);
    }
    LogLine(const LogLine&) = delete;
    LogLine& operator=(const LogLine&) = delete;

    template <typename T>
    LogLine& operator<<(const T& value) {
        stream_ << value;
        return *this;
    }
    LogLine& operator<<(EndOfLine) noexcept { return *this; }
    // Ignores manipulators such as std::endl: each record is a line.
    LogLine& operator<<(std::ostream& (*)(std::ostream&)) noexcept { return *this; }

   private:
    LoggerLevel level_;
    rtcf::rtt_compat::LogBuffer buffer_;
    std::ostream stream_;
};

}  // namespace detail

/// Scope of OROCOS' level names and of log().
class Logger {
   public:
    using LogLevel = LoggerLevel;
    static constexpr LoggerLevel Never = RTT::Never;
    static constexpr LoggerLevel Fatal = RTT::Fatal;
    static constexpr LoggerLevel Critical = RTT::Critical;
    static constexpr LoggerLevel Error = RTT::Error;
    static constexpr LoggerLevel Warning = RTT::Warning;
    static constexpr LoggerLevel Info = RTT::Info;
    static constexpr LoggerLevel Debug = RTT::Debug;
    static constexpr LoggerLevel RealTime = RTT::RealTime;

    /// Ignored: OROCOS prefixes lines with a module name, rtcf with the component's name.
    struct In {
        explicit In(const std::string&) {}
        ~In() {}
    };
    static Logger* Instance() {
        static Logger logger;
        return &logger;
    }
    static detail::LogLine log(LoggerLevel level = RTT::Info) { return detail::LogLine(level); }
    static std::ostream& endl(std::ostream& stream) { return stream; }
    static std::ostream& nl(std::ostream& stream) { return stream; }
    static std::ostream& flush(std::ostream& stream) { return stream; }
    /// Ignored: rqt_logger_level and `rtcfctl` set the levels, per component.
    void setLogLevel(LoggerLevel) noexcept {}
};

inline detail::LogLine log(LoggerLevel level = Info) { return detail::LogLine(level); }
inline detail::EndOfLine endlog() noexcept { return {}; }

}  // namespace RTT
