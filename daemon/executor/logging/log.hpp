/// @file
/// The executor's log: the sink that components' macros write to, and the
/// executor's own records. The real-time thread has a ring of its own; all
/// other threads share another behind a lock. drain() makes texts of what has
/// come and hands them on.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <string>

#include "common/spsc_ring.hpp"
#include "logging/levels.hpp"
#include "logging/log_limit.hpp"
#include "rtcf/logging.hpp"

namespace rtcf::executor {

/// A record as text.
struct LogEntry {
    LogLevel level = LogLevel::Info;
    std::int64_t time_ns = 0;  ///< CLOCK_REALTIME, ns since 1970
    std::uint64_t iteration = 0;
    std::string component;  ///< full name; empty = the executor
    std::string message;
    std::string file;
    std::uint32_t line = 0;
    std::string function;
    bool realtime = false;
    std::string logger;  ///< of what came by ROS_* macros; empty = that of the component
};

class Log final : public LogSink {
   public:
    using Consumer = std::function<void(LogEntry&&)>;

    /// @param consumer gets every record, in drain()
    explicit Log(Consumer consumer) : consumer_(std::move(consumer)) {}

    LogRecord* claim() noexcept override;
    void commit(LogRecord* record) noexcept override;

    /// A record of the executor's own. Not real-time safe.
    void write(LogLevel level, const std::string& component, std::string message);

    /// As write(), of what has been said already; handed on by the next drain(), so that the caller
    /// may hold locks. Time and iteration are noted here.
    void post(LogEntry entry);

    /// Which records are wanted.
    LogLevels& levels() noexcept { return levels_; }

    /// Hands all pending records to the consumer, the oldest first. Any
    /// thread that is not real-time. Called before a component goes away, as
    /// records refer to its name and library.
    void drain();

    /// Records of components, from one line of one of them, that are handed on in a second; 0 = any
    /// number. What is left out is counted, and the count is handed on. Any thread.
    void setLimit(std::uint32_t records) {
        const std::lock_guard<std::mutex> lock(drain_mutex_);
        limit_.set(records);
    }
    /// Hands on all pending records, and what was left out so far: the last call of all.
    void end();

    /// Records lost in full rings.
    std::uint64_t dropped() const noexcept {
        return realtime_.dropped() + others_.dropped() +
               posted_dropped_.load(std::memory_order_relaxed);
    }

    /// Marks the calling thread as the one real-time thread (or not any more).
    /// @param iteration the loop's counter, read at each claim of any thread
    static void setRealtimeThread(bool realtime) noexcept;
    void setIteration(const std::atomic<std::uint64_t>* iteration) noexcept {
        iteration_.store(iteration, std::memory_order_release);
    }

   private:
    static constexpr std::size_t kCapacity = 1024;
    using Ring = SpscRing<LogRecord, kCapacity>;

    std::uint64_t iterationNow() const noexcept;
    void drainOne(Ring& ring);
    void handOn(LogEntry&& entry);
    void reportLeftOut(std::int64_t now_ns);
    void reportDrops();

    Consumer consumer_;
    Ring realtime_;
    Ring others_;
    std::mutex others_mutex_;  // held from claim() to commit() by threads that are not real-time
    std::mutex drain_mutex_;   // down to limit_
    std::uint64_t reported_drops_ = 0;
    LogLimit limit_;
    LogLevels levels_;
    std::mutex posted_mutex_;  // posted_
    std::deque<LogEntry> posted_;
    std::atomic<std::uint64_t> posted_dropped_{0};
    std::atomic<const std::atomic<std::uint64_t>*> iteration_{nullptr};
};

}  // namespace rtcf::executor
