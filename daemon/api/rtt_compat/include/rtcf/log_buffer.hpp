/// @file
/// How a text gets into the log from RTCF 2021's macros and from RTT::log(): made in a bounded
/// buffer on the stack, stored in as many records as it takes.
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
// NOLINTNEXTLINE(modernize-avoid-variadic-functions): as the macros of RTCF 2021
[[gnu::format(printf, 2, 3)]] inline void print(LogBuffer& buffer, const char* format,
                                                ...) noexcept {
    std::va_list arguments;
    va_start(arguments, format);
    buffer.print(format, arguments);
    va_end(arguments);
}

}  // namespace rtcf::rtt_compat
