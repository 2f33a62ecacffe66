/// @file
/// The executor's log: the sink of the components' macros, and the executor's own records. The
/// real-time thread has its own ring; all other threads share another one behind a lock. drain()
/// formats the records and passes them on.
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

/// A formatted record.
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
    std::string logger;  ///< logger of a ROS_* macro; empty = that of the component
};

class Log final : public LogSink {
   public:
    using Consumer = std::function<void(LogEntry&&)>;

    /// @param consumer called by drain() for every record
    explicit Log(Consumer consumer) : consumer_(std::move(consumer)) {}

    LogRecord* claim() noexcept override;
    void commit(LogRecord* record) noexcept override;

    /// Writes a record of the executor. Not real-time safe.
    void write(LogLevel level, const std::string& component, std::string message);

    /// Like write(), but the next drain() passes the entry on, so that the caller may hold locks.
    /// Sets time and iteration. Not real-time safe.
    void post(LogEntry entry);

    /// The log levels.
    LogLevels& levels() noexcept { return levels_; }

    /// Passes all pending records to the consumer, oldest first. Any thread that is not real-time.
    /// Must be called before a component is destroyed, because records refer to its name and
    /// library.
    void drain();

    /// Sets the largest number of records per second from one source line of one component; 0 = no
    /// limit. The log counts suppressed records and reports the count. Any thread.
    void setLimit(std::uint32_t records) {
        const std::lock_guard<std::mutex> lock(drain_mutex_);
        limit_.set(records);
    }
    /// Passes on all pending records and counts of suppressed ones. Must be the last call.
    void end();

    /// Number of records dropped because a ring was full. Any thread.
    std::uint64_t dropped() const noexcept {
        return realtime_.dropped() + others_.dropped() +
               posted_dropped_.load(std::memory_order_relaxed);
    }

    /// Marks the calling thread as the real-time thread, or not any more. Real-time safe.
    static void setRealtimeThread(bool realtime) noexcept;
    /// Sets the loop's counter of cycles, which claim() reads in any thread; null = none.
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
    std::mutex drain_mutex_;   // protects consumer_ to limit_
    std::uint64_t reported_drops_ = 0;
    LogLimit limit_;
    LogLevels levels_;
    std::mutex posted_mutex_;  // protects posted_
    std::deque<LogEntry> posted_;
    std::atomic<std::uint64_t> posted_dropped_{0};
    std::atomic<const std::atomic<std::uint64_t>*> iteration_{nullptr};
};

}  // namespace rtcf::executor
