#include "runner/frame_keeper.hpp"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "logging/log_errors.hpp"

namespace rtcf::executor {

namespace {

// Longest wait for readers that take no frames.
constexpr std::chrono::milliseconds kPatience{250};
constexpr std::chrono::milliseconds kLook{1};

}  // namespace

void FrameKeeper::add(std::uint64_t number, Watch watch) {
    watches_.emplace(number, std::move(watch));
}

std::shared_ptr<const FrameTable> FrameKeeper::prepare(const Plan& plan, double frequency_hz,
                                                       std::size_t most_bytes, Adoption& adoption) {
    std::shared_ptr<const FrameTable> table = makeFrameTable(
        plan, {watches_, frequency_hz, most_bytes, loop_.counter(), &memory_, table_.get()});
    adoption.frames = table->ring.get();
    return table;
}

void FrameKeeper::publish(std::shared_ptr<const FrameTable> table) noexcept {
    const std::shared_ptr<const FrameTable> previous = std::exchange(table_, std::move(table));
    logErrors(log_, "publishing frames", [&] {
        const CycleFrames frames{table_->ring, table_->components};
        statistics_.follow(frames);
        for (const auto& [tap, output] : table_->taps) tap->follow(table_->ring, output);
        {
            const std::lock_guard<std::mutex> lock(mutex_);
            cycles_.follow(frames);
            if (!reads_cycles_) cycles_.skip();
            if (!watches_.empty()) published_.push_back(table_);
        }
        if (table_->shortness.empty()) return;
        const bool reported = previous != nullptr && !previous->shortness.empty() &&
                              previous->ring->capacity() <= table_->ring->capacity();
        if (!reported) log_.write(LogLevel::Warn, {}, table_->shortness);
    });
}

std::uint64_t FrameKeeper::step(std::uint64_t cycles, const std::atomic<bool>* given_up) {
    const std::uint64_t most = table_->ring->capacity() / 2;
    std::uint64_t done = 0;
    while (done < cycles) {
        const std::uint64_t wanted = std::min(cycles - done, most);
        const std::uint64_t ran = loop_.step(wanted, given_up);
        done += ran;
        statistics_.count();
        if (ran < wanted) break;
        awaitReaders();
    }
    return done;
}

bool FrameKeeper::stepOnce() {
    if (loop_.step(1) != 1) return false;
    if (++uncounted_ >= table_->ring->capacity() / 2) {
        statistics_.count();
        uncounted_ = 0;
    }
    return true;
}

void FrameKeeper::awaitReaders() {
    std::function<void()> callback;
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        callback = readers_awaited_;
    }
    const std::uint64_t most = table_->ring->capacity() / 4;
    auto since = std::chrono::steady_clock::now();
    std::uint64_t before = waiting();
    while (before > most && std::chrono::steady_clock::now() - since < kPatience) {
        if (callback) callback();
        std::this_thread::sleep_for(kLook);
        const std::uint64_t now = waiting();
        if (now < before) since = std::chrono::steady_clock::now();
        before = now;
    }
}

// Number of frames that the slowest reader has yet to take.
std::uint64_t FrameKeeper::waiting() const {
    std::uint64_t most = table_->ring->waiting();
    for (const auto& each : table_->taps) most = std::max(most, each.tap->waiting());
    const std::lock_guard<std::mutex> lock(mutex_);
    return reads_cycles_ ? std::max(most, cycles_.waiting()) : most;
}

std::vector<std::shared_ptr<const FrameTable>> FrameKeeper::takePublished() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(published_, {});
}

void FrameKeeper::onReadersAwaited(std::function<void()> callback) {
    const std::lock_guard<std::mutex> lock(mutex_);
    readers_awaited_ = std::move(callback);
}

bool FrameKeeper::nextCycle(CycleRecord& cycle) {
    const std::lock_guard<std::mutex> lock(mutex_);
    reads_cycles_ = true;
    do {
        if (cycles_.next(cycle_) == nullptr) return false;
    } while (cycle_.lastOfLoop());
    cycle = cycle_.cycle();
    return true;
}

void FrameKeeper::skipCycles() {
    const std::lock_guard<std::mutex> lock(mutex_);
    reads_cycles_ = false;
    cycles_.skip();
}

std::uint64_t FrameKeeper::cyclesLost() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return cycles_.lost();
}

}  // namespace rtcf::executor
