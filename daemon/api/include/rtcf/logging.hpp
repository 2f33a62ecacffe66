/// @file
/// Real-time safe logging. A call stores its arguments in a record of fixed size; a worker thread
/// formats the text later. Format strings are those of libfmt, checked at compile time. Arguments
/// are numbers, enums, pointers and strings; strings are cut to 94 bytes.
///
///     RTCF_INFO(this, "gripper at {:.3f} m", position);
///     RTCF_WARN_THROTTLE(this, 1.0, "{} lost packets", lost);   // at most once a second
///     RTCF_ERROR_ONCE(this, "no reply from {}", device);
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <new>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

#include "rtcf/realtime.hpp"

namespace rtcf {

/// Severity, as in ROS.
enum class LogLevel : std::uint8_t { Debug = 1, Info = 2, Warn = 3, Error = 4, Fatal = 5 };

/// Place of a logging call in the source.
struct LogSite {
    LogLevel level;
    const char* file;
    std::uint32_t line;
    const char* function;
    const char* format;
};

/// Size of a record's arguments, bytes.
constexpr std::size_t kLogPayload = 320;

/// The record of one logging call.
struct LogRecord {
    const LogSite* site;
    const char* component;    ///< full name; lives until the record is consumed
    std::int64_t time_ns;     ///< CLOCK_REALTIME at the call, ns since 1970
    std::uint64_t iteration;  ///< the loop's iteration at the call
    bool realtime;            ///< true = called by the real-time thread
    /// Formats the text. Not real-time safe.
    void (*render)(const LogRecord& record, std::string& text);
    alignas(std::max_align_t) std::array<std::byte, kLogPayload> payload;
};

/// Receiver of log records; implemented by the executor.
class LogSink {
   public:
    /// A record to fill, or null if the log is full; the log counts and reports such drops. Time,
    /// iteration and thread are already set. Real-time safe in the cycle; other threads share a
    /// lock.
    virtual LogRecord* claim() noexcept = 0;
    /// Hands over the record from claim(). Real-time safe.
    virtual void commit(LogRecord* record) noexcept = 0;

   protected:
    ~LogSink() = default;
};

/// State of the _ONCE and _THROTTLE macros for one component: for each call, the earliest time of
/// its next record.
class LogMemory {
   public:
    /// The earliest time of the next record of a call, ns. Real-time safe; any thread.
    /// @return null if the table is full of other calls
    std::atomic<std::int64_t>* of(const LogSite& site) noexcept RTCF_NONBLOCKING {
        const std::size_t begin = reinterpret_cast<std::uintptr_t>(&site) / sizeof(LogSite);
        for (std::size_t i = 0; i < entries_.size(); ++i) {
            Entry& entry = entries_[(begin + i) % entries_.size()];
            const LogSite* known = entry.site.load(std::memory_order_acquire);
            if (known == nullptr && entry.site.compare_exchange_strong(known, &site)) known = &site;
            if (known == &site) return &entry.next_ns;
        }
        return nullptr;
    }

   private:
    struct Entry {
        std::atomic<const LogSite*> site{nullptr};
        std::atomic<std::int64_t> next_ns{std::numeric_limits<std::int64_t>::min()};
    };
    std::array<Entry, 32> entries_;
};

namespace detail {

/// A string argument, cut to the capacity of a record.
struct LogText {
    static constexpr std::size_t kCapacity = 94;
    std::uint16_t size;
    std::array<char, kCapacity> bytes;

    explicit LogText(std::string_view text) noexcept
        : size(static_cast<std::uint16_t>(std::min(text.size(), kCapacity))) {
        std::memcpy(bytes.data(), text.data(), size);
    }
    std::string_view view() const noexcept { return {bytes.data(), size}; }
};

/// "(null)" for a null pointer to a text, as of getenv(); other values as they are.
template <typename T>
decltype(auto) textOrNull(const T& value) noexcept {
    if constexpr (std::is_convertible_v<const T&, const char*>) {
        const char* const text = value;
        return std::string_view(text != nullptr ? text : "(null)");
    } else {
        return value;
    }
}

template <typename T>
auto logStore(const T& value) noexcept {
    if constexpr (std::is_convertible_v<const T&, std::string_view>) {
        return LogText(textOrNull(value));
    } else if constexpr (std::is_enum_v<T>) {
        return static_cast<std::underlying_type_t<T>>(value);
    } else if constexpr (std::is_pointer_v<T>) {
        return static_cast<const void*>(value);
    } else {
        static_assert(
            std::is_arithmetic_v<T>,
            "log arguments are numbers, enums, pointers and strings: log an object's members");
        return value;
    }
}

inline std::string_view logLoad(const LogText& text) noexcept { return text.view(); }
template <typename T>
const T& logLoad(const T& value) noexcept {
    return value;  // NOLINT(bugprone-return-const-ref-from-parameter): read before the call ends
}

/// Checks a format at compile time. Never called.
template <typename Format, typename... Arguments>
void formatCheck(const Format& format, const Arguments&... arguments) {
    (void)fmt::formatted_size(format, arguments...);
}

/// Checks a call's format at compile time, for the stored types of the arguments. Never called.
template <typename Format, typename... Arguments>
void logCheck(const Format& format, const Arguments&... arguments) {
    (void)fmt::formatted_size(format, logLoad(logStore(arguments))...);
}

template <typename Stored>
void renderLog(const LogRecord& record, std::string& text) {
    const auto& stored = *std::launder(reinterpret_cast<const Stored*>(record.payload.data()));
    std::apply(
        [&](const auto&... values) {
            // The loaded values must outlive the format arguments that refer to them.
            const auto loaded = std::make_tuple(logLoad(values)...);
            std::apply(
                [&](const auto&... arguments) {
                    text = fmt::vformat(record.site->format, fmt::make_format_args(arguments...));
                },
                loaded);
        },
        stored);
}

/// Fills and commits one record. Real-time safe.
template <typename... Arguments>
void logCall(LogSink& sink, const char* component, const LogSite& site,
             const Arguments&... arguments) noexcept {
    using Stored = std::tuple<decltype(logStore(arguments))...>;
    static_assert(sizeof(Stored) <= kLogPayload, "too many log arguments for one record");
    static_assert(std::is_trivially_destructible_v<Stored>);
    LogRecord* record = sink.claim();
    if (record == nullptr) return;
    record->site = &site;
    record->component = component;
    record->render = &renderLog<Stored>;
    new (record->payload.data()) Stored(logStore(arguments)...);
    sink.commit(record);
}

/// True for one call per `period_ns`, over all threads. Real-time safe.
inline bool logThrottle(std::atomic<std::int64_t>& next_ns, std::int64_t now_ns,
                        std::int64_t period_ns) noexcept {
    std::int64_t due = next_ns.load(std::memory_order_relaxed);
    // If `due` is more than a period ahead, a simulated clock was reset.
    const bool passes = now_ns >= due || due - now_ns > period_ns;
    return passes &&
           next_ns.compare_exchange_strong(due, now_ns + period_ns, std::memory_order_relaxed);
}

/// True for the first call only. Real-time safe.
inline bool logOnce(std::atomic<std::int64_t>& next_ns) noexcept {
    constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();
    return next_ns.exchange(kNever, std::memory_order_relaxed) != kNever;
}

}  // namespace detail

}  // namespace rtcf

/// @name Internals of the macros below
/// @{
#define RTCF_LOG_IF_(self, log_level, condition, text, ...)                                    \
    do {                                                                                       \
        const ::rtcf::Component& rtcf_log_self = *(self);                                      \
        static constexpr ::rtcf::LogSite rtcf_log_site{log_level, __FILE__, __LINE__,          \
                                                       RTCF_LOG_FUNCTION_, text};              \
        if (rtcf_log_self.logs(log_level) && (condition)) {                                    \
            if (false) ::rtcf::detail::logCheck(FMT_STRING(text), ##__VA_ARGS__);              \
            ::rtcf::detail::logCall(rtcf_log_self.logSink(), rtcf_log_self.fullName().c_str(), \
                                    rtcf_log_site, ##__VA_ARGS__);                             \
        }                                                                                      \
    } while (false)
#define RTCF_LOG_FUNCTION_ static_cast<const char*>(__builtin_FUNCTION())
#define RTCF_LOG_(self, log_level, text, ...) \
    RTCF_LOG_IF_(self, log_level, true, text, ##__VA_ARGS__)
// If a component has more such calls than its LogMemory holds, the remaining calls share one time
// per call site, over all components of the class.
#define RTCF_LOG_NEXT_                                                                          \
    ([](::rtcf::LogMemory& memory, const ::rtcf::LogSite& site) -> std::atomic<std::int64_t>& { \
        static std::atomic<std::int64_t> shared{std::numeric_limits<std::int64_t>::min()};      \
        std::atomic<std::int64_t>* own = memory.of(site);                                       \
        return own != nullptr ? *own : shared;                                                  \
    }(rtcf_log_self.logMemory(), rtcf_log_site))
#define RTCF_LOG_ONCE_(self, log_level, text, ...) \
    RTCF_LOG_IF_(self, log_level, ::rtcf::detail::logOnce(RTCF_LOG_NEXT_), text, ##__VA_ARGS__)
#define RTCF_LOG_THROTTLE_(self, log_level, period_s, text, ...)                           \
    RTCF_LOG_IF_(self, log_level,                                                          \
                 ::rtcf::detail::logThrottle(RTCF_LOG_NEXT_, rtcf_log_self.time(),         \
                                             static_cast<std::int64_t>((period_s) * 1e9)), \
                 text, ##__VA_ARGS__)
/// @}

/// @name Logging, usable in every hook; real-time safe
/// `self` is the component, usually `this`. _ONCE logs the first call per component; _THROTTLE logs
/// at most one record per component in `s` seconds of loop time.
/// @{
#define RTCF_DEBUG(self, ...) RTCF_LOG_(self, ::rtcf::LogLevel::Debug, __VA_ARGS__)
#define RTCF_INFO(self, ...) RTCF_LOG_(self, ::rtcf::LogLevel::Info, __VA_ARGS__)
#define RTCF_WARN(self, ...) RTCF_LOG_(self, ::rtcf::LogLevel::Warn, __VA_ARGS__)
#define RTCF_ERROR(self, ...) RTCF_LOG_(self, ::rtcf::LogLevel::Error, __VA_ARGS__)
#define RTCF_FATAL(self, ...) RTCF_LOG_(self, ::rtcf::LogLevel::Fatal, __VA_ARGS__)
#define RTCF_DEBUG_ONCE(self, ...) RTCF_LOG_ONCE_(self, ::rtcf::LogLevel::Debug, __VA_ARGS__)
#define RTCF_INFO_ONCE(self, ...) RTCF_LOG_ONCE_(self, ::rtcf::LogLevel::Info, __VA_ARGS__)
#define RTCF_WARN_ONCE(self, ...) RTCF_LOG_ONCE_(self, ::rtcf::LogLevel::Warn, __VA_ARGS__)
#define RTCF_ERROR_ONCE(self, ...) RTCF_LOG_ONCE_(self, ::rtcf::LogLevel::Error, __VA_ARGS__)
#define RTCF_DEBUG_THROTTLE(self, s, ...) \
    RTCF_LOG_THROTTLE_(self, ::rtcf::LogLevel::Debug, s, __VA_ARGS__)
#define RTCF_INFO_THROTTLE(self, s, ...) \
    RTCF_LOG_THROTTLE_(self, ::rtcf::LogLevel::Info, s, __VA_ARGS__)
#define RTCF_WARN_THROTTLE(self, s, ...) \
    RTCF_LOG_THROTTLE_(self, ::rtcf::LogLevel::Warn, s, __VA_ARGS__)
#define RTCF_ERROR_THROTTLE(self, s, ...) \
    RTCF_LOG_THROTTLE_(self, ::rtcf::LogLevel::Error, s, __VA_ARGS__)
/// @}
