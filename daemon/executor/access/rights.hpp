/// @file
/// Who may do what at this executor without rtcfd between: the rules of
/// rtcfd's [access], by numbers of users and groups.
#pragma once

#include <sys/types.h>

#include <map>
#include <mutex>
#include <optional>
#include <vector>

namespace rtcf::executor {

/// Each with those before it; the words of [access].
enum class Right { None, Observe, Tune, Operate, Admin };

/// As settings and messages write it.
const char* wordOf(Right right) noexcept;

struct AccessRules {
    Right others = Right::None;
    std::map<uid_t, Right> users;
    std::map<gid_t, Right> groups;
    std::optional<gid_t> door_group;  ///< of those who can connect to rtcfd at all
    bool door_open = false;           ///< everybody can
};

/// The rules in force. Until there are any: root and our own user, everything. Any thread.
class Access {
   public:
    void set(AccessRules rules);
    /// What a process with these ids may do. @param groups all of them, the primary one too
    Right of(uid_t user, const std::vector<gid_t>& groups) const;
    /// What a user may do, by the groups that the user database has for it: a look-up that may
    /// block, for threads that nobody waits for.
    Right ofUser(uid_t user) const;

   private:
    mutable std::mutex mutex_;
    AccessRules rules_;
};

}  // namespace rtcf::executor
