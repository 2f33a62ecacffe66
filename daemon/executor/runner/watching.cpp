// Runner: frames for watches.
#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "runner/runner.hpp"

namespace rtcf::executor {

namespace {

// Longest wait for readers that take no frames.
constexpr std::chrono::milliseconds kPatience{250};
constexpr std::chrono::milliseconds kLook{1};

}  // namespace

void Runner::watch(std::uint64_t watch, Watch wanted, bool allow_missing) {
    if (!allow_missing) requireMatches(wanted.selection, *plan_);
    watches_.emplace(watch, std::move(wanted));
    try {
        renewFrames();
    } catch (...) {
        watches_.erase(watch);
        throw;
    }
}

void Runner::endWatch(std::uint64_t watch) {
    if (watches_.erase(watch) != 0) renewFrames();
}

void Runner::onFramesWaiting(std::function<void()> tell) {
    const std::lock_guard<std::mutex> lock(published_mutex_);
    frames_waiting_ = std::move(tell);
}

// Runs steps, which wait for readers of frames.
std::uint64_t Runner::stepWatched(std::uint64_t cycles, const std::atomic<bool>* given_up) {
    if (watches_.empty()) return loop_.step(cycles, given_up);
    const std::uint64_t most = frames_->ring->capacity() / 2;
    std::uint64_t done = 0;
    while (done < cycles) {
        const std::uint64_t wanted = std::min(cycles - done, most);
        const std::uint64_t ran = loop_.step(wanted, given_up);
        done += ran;
        if (ran < wanted) break;
        awaitReaders();
    }
    return done;
}

void Runner::awaitReaders() {
    const FrameRing& ring = *frames_->ring;
    std::function<void()> tell;
    {
        const std::lock_guard<std::mutex> lock(published_mutex_);
        tell = frames_waiting_;
    }
    auto since = std::chrono::steady_clock::now();
    std::uint64_t before = ring.waiting();
    while (before > ring.capacity() / 4 && std::chrono::steady_clock::now() - since < kPatience) {
        if (tell) tell();
        std::this_thread::sleep_for(kLook);
        const std::uint64_t now = ring.waiting();
        if (now < before) since = std::chrono::steady_clock::now();
        before = now;
    }
}

std::shared_ptr<const FrameTable> Runner::framesOf(const Plan& plan) {
    return makeFrameTable(plan, {watches_, settings_.frequency_hz, settings_.frame_bytes,
                                 loop_.cycle(), &frame_memory_, frames_.get()});
}

void Runner::renewFrames() {
    noticeEnd();
    std::shared_ptr<const FrameTable> frames = framesOf(*plan_);
    Adoption adoption;
    adoption.frames = frames->ring.get();
    adoption.timed = frames->turns.wanted();
    adoptAtBoundary(adoption);
    publishFrames(std::move(frames));
}

// After the loop has begun to fill them.
void Runner::publishFrames(std::shared_ptr<const FrameTable> frames) noexcept {
    const std::shared_ptr<const FrameTable> previous = std::exchange(frames_, std::move(frames));
    guarded("publishing frames", [&] {
        if (!watches_.empty()) {
            const std::lock_guard<std::mutex> lock(published_mutex_);
            new_frames_.push_back(frames_);
        }
        if (frames_->shortness.empty()) return;
        const bool told = previous != nullptr && !previous->shortness.empty() &&
                          previous->ring->capacity() <= frames_->ring->capacity();
        if (!told) log_.write(LogLevel::Warn, {}, frames_->shortness);
    });
}

std::vector<std::shared_ptr<const FrameTable>> Runner::takeFrameTables() {
    const std::lock_guard<std::mutex> lock(published_mutex_);
    return std::exchange(new_frames_, {});
}

}  // namespace rtcf::executor
