#include "logging/log.hpp"

#include <fmt/format.h>

#include <ctime>
#include <exception>

namespace rtcf::executor {

namespace {

thread_local bool on_realtime_thread = false;

std::int64_t wallClockNow() noexcept {
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

}  // namespace

void Log::setRealtimeThread(bool realtime) noexcept { on_realtime_thread = realtime; }

LogRecord* Log::claim() noexcept {
    if (!on_realtime_thread) others_mutex_.lock();
    LogRecord* record = (on_realtime_thread ? realtime_ : others_).claim();
    if (record == nullptr) {
        if (!on_realtime_thread) others_mutex_.unlock();
        return nullptr;
    }
    record->time_ns = wallClockNow();
    record->iteration = iterationNow();
    record->realtime = on_realtime_thread;
    return record;
}

void Log::commit(LogRecord* /*record*/) noexcept {
    if (on_realtime_thread) {
        realtime_.commit();
    } else {
        others_.commit();
        others_mutex_.unlock();
    }
}

void Log::write(LogLevel level, const std::string& component, std::string message) {
    LogEntry entry;
    entry.level = level;
    entry.time_ns = wallClockNow();
    entry.iteration = iterationNow();
    entry.component = component;
    entry.message = std::move(message);
    const std::lock_guard<std::mutex> lock(drain_mutex_);
    consumer_(std::move(entry));
}

std::uint64_t Log::iterationNow() const noexcept {
    const std::atomic<std::uint64_t>* iteration = iteration_.load(std::memory_order_acquire);
    return iteration != nullptr ? iteration->load(std::memory_order_relaxed) : 0;
}

void Log::post(LogEntry entry) {
    entry.time_ns = wallClockNow();
    entry.iteration = iterationNow();
    const std::lock_guard<std::mutex> lock(posted_mutex_);
    if (posted_.size() >= kCapacity) {
        posted_dropped_.fetch_add(1, std::memory_order_relaxed);
        return;
    }
    posted_.push_back(std::move(entry));
}

void Log::drain() {
    const std::lock_guard<std::mutex> lock(drain_mutex_);
    std::deque<LogEntry> posted;
    {
        const std::lock_guard<std::mutex> posted_lock(posted_mutex_);
        posted.swap(posted_);
    }
    // Merges posted entries with those of the rings, by time.
    const auto handOnUntil = [&](std::int64_t time_ns) {
        while (!posted.empty() && posted.front().time_ns <= time_ns) {
            handOn(std::move(posted.front()));
            posted.pop_front();
        }
    };
    for (;;) {
        const LogRecord* other = others_.front();
        const LogRecord* realtime = realtime_.front();
        if (other == nullptr && realtime == nullptr) break;
        const bool is_realtime =
            other == nullptr || (realtime != nullptr && realtime->time_ns < other->time_ns);
        handOnUntil((is_realtime ? realtime : other)->time_ns);
        drainOne(is_realtime ? realtime_ : others_);
    }
    handOnUntil(INT64_MAX);
    reportLeftOut(wallClockNow());
    reportDrops();
}

void Log::end() {
    drain();
    const std::lock_guard<std::mutex> lock(drain_mutex_);
    reportLeftOut(INT64_MAX);
}

// Passes an entry on. Entries of the executor itself are not limited.
void Log::handOn(LogEntry&& entry) {
    const LogOrigin origin{entry.component, entry.file, entry.line, entry.level};
    if (origin.component.empty() || limit_.admit(origin, entry.time_ns))
        consumer_(std::move(entry));
}

void Log::reportLeftOut(std::int64_t now_ns) {
    limit_.report(now_ns, [this](const LogOrigin& origin, std::uint64_t count) {
        LogEntry entry;
        entry.level = origin.level;
        entry.time_ns = wallClockNow();
        entry.iteration = iterationNow();
        entry.component = origin.component;
        entry.file = origin.file;
        entry.line = origin.line;
        entry.message =
            fmt::format("{} more records of this line within a second were suppressed", count);
        consumer_(std::move(entry));
    });
}

void Log::drainOne(Ring& ring) {
    const LogRecord* record = ring.front();
    const LogOrigin origin{record->component, record->site->file, record->site->line,
                           record->site->level};
    if (!limit_.admit(origin, record->time_ns)) {
        ring.pop();
        return;
    }
    LogEntry entry;
    entry.level = record->site->level;
    entry.time_ns = record->time_ns;
    entry.iteration = record->iteration;
    entry.component = record->component;
    entry.file = record->site->file;
    entry.line = record->site->line;
    entry.function = record->site->function;
    entry.realtime = record->realtime;
    try {
        record->render(*record, entry.message);
    } catch (const std::exception& error) {
        entry.message =
            fmt::format("{} (cannot be formatted: {})", record->site->format, error.what());
    }
    ring.pop();
    consumer_(std::move(entry));
}

void Log::reportDrops() {
    const std::uint64_t now = dropped();
    if (now == reported_drops_) return;
    LogEntry entry;
    entry.level = LogLevel::Warn;
    entry.time_ns = wallClockNow();
    entry.message =
        fmt::format("{} log records were dropped: components log faster than they can be written",
                    now - reported_drops_);
    reported_drops_ = now;
    consumer_(std::move(entry));
}

}  // namespace rtcf::executor
