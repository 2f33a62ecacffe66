/// @file
/// The stream of RtcfExtension::rtLogStream().
#pragma once

#include <ros/console.h>

#include <array>
#include <ostream>

#include "rtcf/log_buffer.hpp"

namespace rtcf::rtt_compat {

/// The severity of a level of rosconsole.
constexpr LogLevel levelOf(ros::console::Level level) {
    return static_cast<LogLevel>(static_cast<int>(level) + 1);
}

/// Source of the texts from RtcfExtension's functions; one per level.
inline const LogSite& logSite(LogLevel level) {
    static constexpr auto at = [](LogLevel of) { return LogSite{of, "", 0, "rtLog", "{}"}; };
    static constexpr std::array<LogSite, 5> kSites{at(LogLevel::Debug), at(LogLevel::Info),
                                                   at(LogLevel::Warn), at(LogLevel::Error),
                                                   at(LogLevel::Fatal)};
    return kSites.at(static_cast<std::size_t>(level) - 1);
}

/// Stream for one text, which is logged at the end of the statement. Real-time safe if the
/// operators of its operands are.
class LogStream {
   public:
    /// @param component null = no log
    LogStream(const Component* component, LogLevel level) noexcept
        : component_(component != nullptr && component->logs(level) ? component : nullptr),
          level_(level),
          stream_(&buffer_) {}
    ~LogStream() {
        if (component_ != nullptr) log(*component_, logSite(level_), buffer_.text());
    }
    LogStream(const LogStream&) = delete;
    LogStream& operator=(const LogStream&) = delete;

    template <typename T>
    LogStream& operator<<(const T& value) {
        if (component_ != nullptr) stream_ << value;
        return *this;
    }
    // Ignores std::endl and std::flush: each record is a line.
    LogStream& operator<<(std::ostream& (*)(std::ostream&)) noexcept { return *this; }

   private:
    const Component* component_;
    LogLevel level_;
    LogBuffer buffer_;
    std::ostream stream_;
};

}  // namespace rtcf::rtt_compat
