#include "view/settings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/error.hpp"
#include "names/name_pattern.hpp"
#include "names/names.hpp"
#include "realtime/cpu_claim.hpp"

namespace rtcf::executor {

namespace {

[[noreturn]] void refuse(const std::string& message) {
    throw Error(ErrorKind::InvalidArgument, message);
}

template <typename T>
void requireRange(const char* name, T value, T lowest, T highest, const char* unit) {
    // This form rejects NaN.
    if (value >= lowest && value <= highest) return;
    refuse(fmt::format("{} {} {} is out of range: {} to {} {}", name, value, unit, lowest, highest,
                       unit));
}

void requireCpu(int cpu) {
    if (cpu == -1) return;
    const std::vector<int>& allowed = processCpus();
    if (std::find(allowed.begin(), allowed.end(), cpu) != allowed.end()) return;
    refuse(fmt::format(
        "cpu {} is not available to this daemon: use one of {}, or -1 for an automatic choice", cpu,
        fmt::join(allowed, ", ")));
}

}  // namespace

void validate(RunnerSettings& settings) {
    constexpr double kLowestHz = 0.1;
    constexpr double kHighestHz = 50000.0;
    constexpr std::size_t kKilo = 1024;
    requireRange("frequency", settings.frequency_hz, kLowestHz, kHighestHz, "Hz");
    settings.loop.period_ns = std::llround(1e9 / settings.frequency_hz);
    requireCpu(settings.loop.realtime.cpu);
    requireRange("priority", settings.loop.realtime.priority, 1U, 98U, "(SCHED_FIFO)");
    requireRange("spin", settings.loop.spin_ns / 1000, std::int64_t{0},
                 settings.loop.period_ns / 2000, "µs");
    requireRange("heap", settings.loop.realtime.heap_bytes / kKilo, std::size_t{0}, 1024 * kKilo,
                 "KiB");
    requireRange("stack", settings.loop.realtime.stack_bytes / kKilo, std::size_t{16}, 64 * kKilo,
                 "KiB");
    requireRange("stall timeout", settings.stall_timeout_ns / 1'000'000, std::int64_t{0},
                 std::int64_t{3'600'000}, "ms");
    requireRange("hook timeout", static_cast<double>(settings.hook_timeout_ns) / 1e9, 0.1, 3600.0,
                 "s");
    requireRange("orphan timeout", static_cast<double>(settings.orphan_timeout_ns) / 1e9, 0.0, 1e6,
                 "s");
    requireRange("max clock jump", static_cast<double>(settings.max_clock_jump_ns) / 1e9, 0.0, 1e6,
                 "s");
    requireRange("frame", settings.frame_bytes / kKilo, std::size_t{0}, kKilo, "KiB");
    requireRange("log limit", settings.log_limit, 0U, 1'000'000U, "records a second");
    if (!settings.bridge.name_space.empty())
        settings.bridge.name_space = canonicalNamespace(settings.bridge.name_space);
    requireRange("queue", settings.bridge.queue, 1U, 1'000'000U, "messages");
    requireRange("decimation", settings.bridge.decimation, 1U, 1'000'000U, "values");
    requireRange("largest message", settings.bridge.largest_message / 1024, 1U, 64U * 1024, "KiB");
    (void)NamePattern("latch", settings.bridge.latch);
    (void)NamePattern("decimate", settings.bridge.decimate);
    (void)NamePattern("stamped", settings.bridge.stamped);
    (void)NamePattern("whitelist", settings.whitelist);
    (void)NamePattern("blacklist", settings.blacklist);
}

}  // namespace rtcf::executor
