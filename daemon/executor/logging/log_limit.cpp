#include "logging/log_limit.hpp"

#include "common/time_units.hpp"

namespace rtcf::executor {

namespace {}  // namespace

bool LogLimit::admit(const LogOrigin& origin, std::int64_t time_ns) {
    if (limit_ == 0) return true;
    Second& second = origins_.try_emplace(origin, Second{time_ns, 0, 0}).first->second;
    if (time_ns - second.begin_ns >= kSecond && second.left_out == 0) second = {time_ns, 0, 0};
    if (second.admitted < limit_) {
        ++second.admitted;
        return true;
    }
    ++second.left_out;
    return false;
}

void LogLimit::report(std::int64_t now_ns, const Report& report) {
    for (auto origin = origins_.begin(); origin != origins_.end();) {
        const Second& second = origin->second;
        // A clock that was set back ends the second too.
        if (now_ns - second.begin_ns < kSecond && now_ns >= second.begin_ns) {
            ++origin;
            continue;
        }
        if (second.left_out != 0) report(origin->first, second.left_out);
        origin = origins_.erase(origin);
    }
}

}  // namespace rtcf::executor
