#include "access/rights.hpp"

#include <grp.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <array>

namespace rtcf::executor {

const char* wordOf(Right right) noexcept {
    switch (right) {
        case Right::None:
            break;
        case Right::Observe:
            return "observe";
        case Right::Tune:
            return "tune";
        case Right::Operate:
            return "operate";
        case Right::Admin:
            return "admin";
    }
    return "none";
}

void Access::set(AccessRules rules) {
    const std::lock_guard<std::mutex> lock(mutex_);
    rules_ = std::move(rules);
}

Right Access::of(uid_t user, const std::vector<gid_t>& groups) const {
    if (user == 0 || user == ::geteuid()) return Right::Admin;
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto belongs = [&](gid_t group) {
        return std::find(groups.begin(), groups.end(), group) != groups.end();
    };
    if (!rules_.door_open && !(rules_.door_group && belongs(*rules_.door_group)))
        return Right::None;
    if (const auto own = rules_.users.find(user); own != rules_.users.end()) return own->second;
    std::optional<Right> highest;
    for (const auto& [group, right] : rules_.groups) {
        if (belongs(group)) highest = std::max(highest.value_or(Right::None), right);
    }
    return highest.value_or(rules_.others);
}

Right Access::ofUser(uid_t user) const {
    std::array<char, 16384> text{};
    passwd entry{};
    passwd* found = nullptr;
    std::vector<gid_t> groups;
    if (::getpwuid_r(user, &entry, text.data(), text.size(), &found) == 0 && found != nullptr) {
        int count = 256;
        groups.resize(static_cast<std::size_t>(count));
        if (::getgrouplist(found->pw_name, found->pw_gid, groups.data(), &count) < 0) {
            groups.resize(static_cast<std::size_t>(count));
            if (::getgrouplist(found->pw_name, found->pw_gid, groups.data(), &count) < 0) count = 0;
        }
        groups.resize(static_cast<std::size_t>(count));
    }
    return of(user, groups);
}

}  // namespace rtcf::executor
