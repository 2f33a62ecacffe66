#include "runner/fault_report_limit.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "common/time_units.hpp"

namespace rtcf::executor {

namespace {

constexpr std::int64_t kShortest = 10 * kSecond;
constexpr std::int64_t kLongest = 600 * kSecond;
// A fault this soon after a silence continues the series.
constexpr std::int64_t kSoon = kSecond;

}  // namespace

std::uint64_t FaultReportLimit::noteReport(const std::shared_ptr<ComponentStatistics>& of,
                                           std::int64_t now_ns) {
    const std::uint64_t count = of->faults.count.value();
    const auto [found, is_new] = silences_.try_emplace(of);
    Silence& silence = found->second;
    const bool goes_on = !is_new && now_ns - silence.until_ns < kSoon;
    silence.length_ns = goes_on ? std::min(2 * silence.length_ns, kLongest) : kShortest;
    silence.until_ns = now_ns + silence.length_ns;
    silence.over = false;
    const std::uint64_t before = std::exchange(silence.count, count);
    return is_new ? 0 : count - before;
}

void FaultReportLimit::rearm(std::int64_t now_ns) {
    for (auto it = silences_.begin(); it != silences_.end();) {
        Silence& silence = it->second;
        if (!silence.over && now_ns >= silence.until_ns) {
            it->first->faults.rearm();
            silence.over = true;
        }
        const bool forgotten = silence.over && now_ns - silence.until_ns > kLongest;
        it = forgotten ? silences_.erase(it) : std::next(it);
    }
}

}  // namespace rtcf::executor
