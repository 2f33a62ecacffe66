#include "runner/loop_boundary.hpp"

#include <fmt/format.h>

#include <utility>

#include "common/error.hpp"
#include "common/time_units.hpp"

namespace rtcf::executor {

namespace {

// Limit of the memory that one boundary touches at 2 kHz; scaled with the period at other
// frequencies.
constexpr std::int64_t kMostBytes = 64 * 1024;
constexpr std::int64_t kPeriodOfMostBytes = 500'000;  // ns

}  // namespace

LoopBoundary::LoopBoundary(std::string runner, const RunnerSettings& settings, Loop& loop,
                           const FlightRecorder& recorder)
    : runner_(std::move(runner)), settings_(settings), loop_(loop), recorder_(recorder) {}

void LoopBoundary::adopt(Adoption& adoption) {
    if (loop_.adopt(adoption, timeout())) return;
    throw Error(ErrorKind::Unavailable,
                fmt::format("the loop of {} reaches no cycle boundary: {}; nothing has changed",
                            runner_, whatHoldsIt()));
}

void LoopBoundary::capture(Capture& capture) {
    if (loop_.capture(capture, timeout())) return;
    throw Error(ErrorKind::Unavailable, fmt::format("the loop of {} reaches no cycle boundary: {}",
                                                    runner_, whatHoldsIt()));
}

std::size_t LoopBoundary::mostBytes() const {
    if (!loop_.inRealTime()) return SIZE_MAX;
    return static_cast<std::size_t>(kMostBytes * settings_.loop.period_ns / kPeriodOfMostBytes);
}

void LoopBoundary::requireSmall(std::size_t bytes, const char* what) const {
    const std::size_t most = mostBytes();
    if (bytes <= most) return;
    throw Error(
        ErrorKind::StateTooLarge,
        fmt::format(
            "{} touches {} bytes in one cycle of {}; the limit is {} at {:g} Hz: stop the loop, "
            "lower its frequency, or change fewer components at a time",
            what, bytes, runner_, most, settings_.frequency_hz));
}

std::int64_t LoopBoundary::timeout() const noexcept {
    return kSecond + 10 * settings_.loop.period_ns;
}

std::string LoopBoundary::whatHoldsIt() const {
    const std::string activity = recorder_.realtimeActivity();
    return activity.empty() ? "its thread gets too little processor time"
                            : activity + "() does not return";
}

}  // namespace rtcf::executor
