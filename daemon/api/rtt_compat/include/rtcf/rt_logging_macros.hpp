/// @file
/// RTCF 2021's logging macros, for members of components. All of them may be
/// used in every hook and are real-time safe as far as their arguments are: a
/// text is made in a bounded buffer on the stack and stored in the log, from
/// which it goes to the journal and to ROS.
///
///     RT_INFO("ready");
///     RT_WARN_STREAM("force " << force << " N");
///     NON_RT_INFO("%d joints", joints);
#pragma once

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <ostream>
#include <streambuf>
#include <string_view>

#include "rtcf/component.hpp"

namespace rtcf::rtt_compat {

/// Longest text of one call, characters; what is longer is cut, and ends in "...".
constexpr std::size_t kLongestLog = 1000;

/// A text in the making, on the stack.
class LogBuffer final : public std::streambuf {
   public:
    LogBuffer() noexcept { setp(text_.data(), text_.data() + kLongestLog); }

    /// What is there so far. Real-time safe.
    std::string_view text() noexcept {
        const auto size = static_cast<std::size_t>(pptr() - pbase());
        if (cut_) std::memcpy(text_.data() + size, "...", 3);
        return {text_.data(), size + (cut_ ? 3 : 0)};
    }
    void append(std::string_view text) noexcept {
        xsputn(text.data(), static_cast<std::streamsize>(text.size()));
    }
    /// As std::printf. Real-time safe for numbers and strings.
    void print(const char* format, std::va_list arguments) noexcept {
        const int size = std::vsnprintf(text_.data(), kLongestLog + 1, format, arguments);
        if (size <= 0) return;
        cut_ = static_cast<std::size_t>(size) > kLongestLog;
        pbump(static_cast<int>(std::min(static_cast<std::size_t>(size), kLongestLog)));
    }

   private:
    // What finds no room is cut off, without making the stream fail.
    int_type overflow(int_type character) override {
        cut_ = true;
        return traits_type::not_eof(character);
    }
    std::streamsize xsputn(const char* text, std::streamsize size) noexcept override {
        const std::streamsize fits = std::min<std::streamsize>(size, epptr() - pptr());
        std::memcpy(pptr(), text, static_cast<std::size_t>(fits));
        pbump(static_cast<int>(fits));
        cut_ = cut_ || fits < size;
        return size;
    }

    bool cut_ = false;
    std::array<char, kLongestLog + 4> text_;
};

/// A part of a text, as a log record holds it.
struct LogPart {
    static constexpr std::size_t kCapacity = kLogPayload - sizeof(std::uint16_t);
    std::uint16_t size;
    std::array<char, kCapacity> bytes;
};
static_assert(sizeof(LogPart) <= kLogPayload);

inline void renderLogPart(const LogRecord& record, std::string& text) {
    const auto& part = *std::launder(reinterpret_cast<const LogPart*>(record.payload.data()));
    text.assign(part.bytes.data(), part.size);
}

/// Hands a text to the log, in as many records as it takes. Real-time safe.
inline void log(const Component& component, const LogSite& site, std::string_view text) noexcept {
    do {
        LogRecord* record = component.logSink().claim();
        if (record == nullptr) return;  // counted and reported by the log
        const std::string_view part = text.substr(0, LogPart::kCapacity);
        text.remove_prefix(part.size());
        record->site = &site;
        record->component = component.fullName().c_str();
        record->render = &renderLogPart;
        auto* const stored = new (record->payload.data()) LogPart;
        stored->size = static_cast<std::uint16_t>(part.size());
        std::memcpy(stored->bytes.data(), part.data(), part.size());
        component.logSink().commit(record);
    } while (!text.empty());
}

/// Of the forms without a stream: a text as it is.
inline void fill(LogBuffer& buffer, std::string_view text) noexcept { buffer.append(text); }
/// A format with its arguments, as of std::printf.
[[gnu::format(printf, 2, 3)]] inline void print(LogBuffer& buffer, const char* format,
                                                ...) noexcept {
    std::va_list arguments;
    va_start(arguments, format);
    buffer.print(format, arguments);
    va_end(arguments);
}

}  // namespace rtcf::rtt_compat

/// @name Internals of the macros below
/// @{
#define RTCF_COMPAT_LOG_(log_level, format, fill_buffer)                                   \
    do {                                                                                   \
        const ::rtcf::Component& rtcf_log_self = *this;                                    \
        if (rtcf_log_self.logs(log_level)) {                                               \
            static constexpr ::rtcf::LogSite rtcf_log_site{log_level, __FILE__, __LINE__,  \
                                                           RTCF_LOG_FUNCTION_, format};    \
            ::rtcf::rtt_compat::LogBuffer rtcf_log_buffer;                                 \
            fill_buffer;                                                                   \
            ::rtcf::rtt_compat::log(rtcf_log_self, rtcf_log_site, rtcf_log_buffer.text()); \
        }                                                                                  \
    } while (false)
#define RTCF_COMPAT_TEXT_(log_level, text) \
    RTCF_COMPAT_LOG_(log_level, "{}", ::rtcf::rtt_compat::fill(rtcf_log_buffer, text))
#define RTCF_COMPAT_PRINT_(log_level, ...) \
    RTCF_COMPAT_LOG_(log_level, "{}", ::rtcf::rtt_compat::print(rtcf_log_buffer, __VA_ARGS__))
#define RTCF_COMPAT_STREAM_(log_level, arguments)          \
    RTCF_COMPAT_LOG_(log_level, "{}", {                    \
        std::ostream rtcf_log_stream(&rtcf_log_buffer);    \
        rtcf_log_stream << arguments; /* NOLINT: a list */ \
    })
/// @}

/// @name A text, as it is
/// @{
#define RT_DEBUG(text) RTCF_COMPAT_TEXT_(::rtcf::LogLevel::Debug, text)
#define RT_INFO(text) RTCF_COMPAT_TEXT_(::rtcf::LogLevel::Info, text)
#define RT_WARN(text) RTCF_COMPAT_TEXT_(::rtcf::LogLevel::Warn, text)
#define RT_ERROR(text) RTCF_COMPAT_TEXT_(::rtcf::LogLevel::Error, text)
#define RT_FATAL(text) RTCF_COMPAT_TEXT_(::rtcf::LogLevel::Fatal, text)
/// @}

/// @name What would be written to a std::ostream
/// @{
#define RT_DEBUG_STREAM(arguments) RTCF_COMPAT_STREAM_(::rtcf::LogLevel::Debug, arguments)
#define RT_INFO_STREAM(arguments) RTCF_COMPAT_STREAM_(::rtcf::LogLevel::Info, arguments)
#define RT_WARN_STREAM(arguments) RTCF_COMPAT_STREAM_(::rtcf::LogLevel::Warn, arguments)
#define RT_ERROR_STREAM(arguments) RTCF_COMPAT_STREAM_(::rtcf::LogLevel::Error, arguments)
#define RT_FATAL_STREAM(arguments) RTCF_COMPAT_STREAM_(::rtcf::LogLevel::Fatal, arguments)
/// @}

/// @name As std::printf, and the stream forms again
/// RTCF 2021 throws when these are used in the loop; here they are as safe as those above.
/// @{
#define NON_RT_DEBUG(...) RTCF_COMPAT_PRINT_(::rtcf::LogLevel::Debug, __VA_ARGS__)
#define NON_RT_INFO(...) RTCF_COMPAT_PRINT_(::rtcf::LogLevel::Info, __VA_ARGS__)
#define NON_RT_WARN(...) RTCF_COMPAT_PRINT_(::rtcf::LogLevel::Warn, __VA_ARGS__)
#define NON_RT_ERROR(...) RTCF_COMPAT_PRINT_(::rtcf::LogLevel::Error, __VA_ARGS__)
#define NON_RT_FATAL(...) RTCF_COMPAT_PRINT_(::rtcf::LogLevel::Fatal, __VA_ARGS__)
#define NON_RT_DEBUG_STREAM(arguments) RT_DEBUG_STREAM(arguments)
#define NON_RT_INFO_STREAM(arguments) RT_INFO_STREAM(arguments)
#define NON_RT_WARN_STREAM(arguments) RT_WARN_STREAM(arguments)
#define NON_RT_ERROR_STREAM(arguments) RT_ERROR_STREAM(arguments)
#define NON_RT_FATAL_STREAM(arguments) RT_FATAL_STREAM(arguments)
/// @}
