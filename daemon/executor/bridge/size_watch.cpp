#include "bridge/size_watch.hpp"

#include <fmt/format.h>

#include <iterator>

namespace rtcf::executor {

namespace {

constexpr std::int64_t kQuiet = 10'000'000'000;  // ns between reports of one connection
constexpr std::size_t kKilo = 1024;

}  // namespace

void SizeWatch::look(const std::map<std::string, std::shared_ptr<SerializedTap>>& taps,
                     const std::map<std::string, std::shared_ptr<Injector>>& injectors,
                     std::size_t largest, std::int64_t now_ns) {
    for (auto known = known_.begin(); known != known_.end();)
        known = known->first.expired() ? known_.erase(known) : std::next(known);
    for (const auto& [topic, tap] : taps) {
        if (const std::uint64_t count = tap->tooLarge(); count != 0)
            note(topic, tap, count, "not published", largest, now_ns);
    }
    for (const auto& [topic, injector] : injectors) {
        if (const std::uint64_t count = injector->tooLarge(); count != 0)
            note(topic, injector, count, "not received", largest, now_ns);
    }
}

void SizeWatch::note(const std::string& topic, const Connection& connection, std::uint64_t count,
                     const char* what, std::size_t largest, std::int64_t now_ns) {
    Known& known = known_[connection];
    total_ += count - known.counted;
    known.counted = count;
    if (count == known.reported || now_ns < known.next_report_ns) return;
    report_(
        fmt::format("{}: {} messages larger than {} KiB {}: raise the limit: rtcfctl runner set {} "
                    "--largest-message KIB",
                    topic, count - known.reported, largest / kKilo, what, runner_));
    known.reported = count;
    known.next_report_ns = now_ns + kQuiet;
}

}  // namespace rtcf::executor
