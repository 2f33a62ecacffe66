/// @file
/// Path of a text from RTCF 2021's macros and from RTT::log() into the log: it is formatted in a
/// bounded buffer on the stack, and split into as many records as needed.
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

/// Longest text of one call, bytes; a longer text is cut and ends in "...".
constexpr std::size_t kLongestLog = 1000;

/// A stream buffer on the stack for one text.
class LogBuffer final : public std::streambuf {
   public:
    LogBuffer() noexcept { setp(text_.data(), text_.data() + kLongestLog); }

    /// The text so far. Real-time safe.
    std::string_view text() noexcept {
        const auto size = static_cast<std::size_t>(pptr() - pbase());
        if (cut_) std::memcpy(text_.data() + size, "...", 3);
        return {text_.data(), size + (cut_ ? 3 : 0)};
    }
    /// Appends a text. Real-time safe.
    void append(std::string_view text) noexcept {
        xsputn(text.data(), static_cast<std::streamsize>(text.size()));
    }
    /// Formats like std::printf. Real-time safe for numbers and strings.
    void print(const char* format, std::va_list arguments) noexcept {
        const int size = std::vsnprintf(text_.data(), kLongestLog + 1, format, arguments);
        if (size <= 0) return;
        cut_ = static_cast<std::size_t>(size) > kLongestLog;
        pbump(static_cast<int>(std::min(static_cast<std::size_t>(size), kLongestLog)));
    }

   private:
    // Drops text beyond the capacity without making the stream fail.
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

/// Part of a text in one log record.
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

/// Logs a text in as many records as needed. Real-time safe.
inline void log(const Component& component, const LogSite& site, std::string_view text) noexcept {
    do {
        LogRecord* record = component.logSink().claim();
        if (record == nullptr) return;  // the log counts and reports the drop
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

/// Appends a text verbatim. Real-time safe.
inline void fill(LogBuffer& buffer, std::string_view text) noexcept { buffer.append(text); }
/// Formats like std::printf. Real-time safe for numbers and strings.
// NOLINTNEXTLINE(modernize-avoid-variadic-functions): as the macros of RTCF 2021
[[gnu::format(printf, 2, 3)]] inline void print(LogBuffer& buffer, const char* format,
                                                ...) noexcept {
    std::va_list arguments;
    va_start(arguments, format);
    buffer.print(format, arguments);
    va_end(arguments);
}

}  // namespace rtcf::rtt_compat
