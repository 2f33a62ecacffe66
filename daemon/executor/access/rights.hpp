/// @file
/// Access rights at this executor's own interfaces, which rtcfd does not check: the rules of
/// rtcfd's [access], with numeric user and group ids.
#pragma once

#include <sys/types.h>

#include <map>
#include <mutex>
#include <optional>
#include <vector>

namespace rtcf::executor {

/// Each right includes those before it. The names are those of [access].
enum class Right { None, Observe, Tune, Operate, Admin };

/// The right's name in settings and messages.
const char* wordOf(Right right) noexcept;

struct AccessRules {
    Right others = Right::None;
    std::map<uid_t, Right> users;
    std::map<gid_t, Right> groups;
    std::optional<gid_t> door_group;  ///< group that may connect to rtcfd's socket
    bool door_open = false;           ///< everybody may connect
};

/// The rules in force. Before set(), only root and the executor's own user have a right: admin. Any
/// thread.
class Access {
   public:
    void set(AccessRules rules);
    /// The right of a process with these ids.
    /// @param groups all groups of the process, including the primary one
    Right of(uid_t user, const std::vector<gid_t>& groups) const;
    /// The right of a user, with the groups from the user database. The look-up may block, so it is
    /// only for threads that may wait.
    Right ofUser(uid_t user) const;

   private:
    mutable std::mutex mutex_;
    AccessRules rules_;
};

}  // namespace rtcf::executor
