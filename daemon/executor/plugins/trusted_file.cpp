#include "plugins/trusted_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "common/error.hpp"

namespace rtcf::executor {

namespace {

constexpr uid_t kFirstPerson = 1000;  // Debian policy 9.2.2: smaller ids are system users

std::string nameOf(uid_t uid) {
    std::array<char, 4096> buffer{};
    passwd entry{};
    passwd* found = nullptr;
    if (::getpwuid_r(uid, &entry, buffer.data(), buffer.size(), &found) == 0 && found != nullptr)
        return found->pw_name;
    return fmt::format("#{}", uid);
}

class Walk {
   public:
    Walk(std::string subject, const std::set<uid_t>& owners)
        : subject_(std::move(subject)), owners_(owners) {}
    ~Walk() {
        if (at_ >= 0) ::close(at_);
    }
    Walk(const Walk&) = delete;
    Walk& operator=(const Walk&) = delete;

    int open(const std::string& wanted) {
        std::error_code error;
        const std::filesystem::path real = std::filesystem::canonical(wanted, error);
        if (error) refuse(error.message());
        for (auto part = real.begin(); part != real.end(); ++part) {
            const bool last = std::next(part) == real.end();
            if (!step(*part, last ? O_RDONLY | O_NONBLOCK : O_PATH | O_DIRECTORY))
                refuse(fmt::format("{}: {}", (seen_ / *part).string(), std::strerror(errno)));
            const struct stat status = statusHere();
            if (last && !S_ISREG(status.st_mode)) refuse("not a regular file");
            // In a sticky folder, only a file's owner can replace it, and the owner is checked
            // next.
            check(status, !last && (status.st_mode & S_ISVTX) != 0);
        }
        return std::exchange(at_, -1);
    }

    /// Requires that only trusted users can create or change files in the folder; the folder may
    /// not exist yet.
    void requireFolder(const std::string& wanted) {
        std::error_code error;
        const std::filesystem::path real = std::filesystem::weakly_canonical(wanted, error);
        if (error) refuse(fmt::format("{}: {}", wanted, error.message()));
        struct stat status{};
        for (const std::filesystem::path& part : real) {
            if (part.empty()) continue;  // part after a trailing slash
            if (!step(part, O_PATH | O_DIRECTORY)) {
                if (errno == ENOENT || errno == ENOTDIR) break;
                refuse(fmt::format("{}: {}", (seen_ / part).string(), std::strerror(errno)));
            }
            status = statusHere();
            check(status, (status.st_mode & S_ISVTX) != 0);
        }
        check(status, false);
    }

   private:
    [[noreturn]] void refuse(const std::string& why) const {
        throw Error(ErrorKind::LibraryRejected, fmt::format("{}: {}", subject_, why));
    }

    // Opens the next part of the path. All symbolic links were resolved before, so a link now is an
    // attack.
    bool step(const std::filesystem::path& part, int flags) {
        const int next =
            ::openat(at_ < 0 ? AT_FDCWD : at_, part.c_str(), flags | O_NOFOLLOW | O_CLOEXEC);
        if (next < 0) return false;
        if (at_ >= 0) ::close(at_);
        at_ = next;
        seen_ /= part;
        return true;
    }

    struct stat statusHere() const {
        struct stat status{};
        if (::fstat(at_, &status) != 0) refuse(std::strerror(errno));
        return status;
    }

    void check(const struct stat& status, bool anybody_may_write) const {
        const bool trusted = status.st_uid == 0 || owners_.count(status.st_uid) != 0;
        if (!trusted) distrust("belongs to user " + nameOf(status.st_uid));
        if (anybody_may_write) return;
        if ((status.st_mode & S_IWOTH) != 0) distrust("can be written by everybody");
        // A user's private group (adduser(8), USERGROUPS) is trusted like the user.
        const bool own_group =
            status.st_gid == 0 || (status.st_gid == status.st_uid && status.st_uid >= kFirstPerson);
        if ((status.st_mode & S_IWGRP) != 0 && !own_group) distrust("can be written by its group");
    }

    // The text does not advise to change permissions: the folder may be a home or /tmp.
    [[noreturn]] void distrust(const std::string& why) const {
        refuse(fmt::format(
            "{} {}, so its code is not trusted: install it as root (components into "
            "/usr/lib/rtcf-components/PACKAGE), or name the component folder of a trusted user "
            "under path in rtcfd's settings",
            seen_.string(), why));
    }

    const std::string subject_;
    const std::set<uid_t>& owners_;
    std::filesystem::path seen_;
    int at_ = -1;
};

}  // namespace

int openTrusted(const std::string& path, const std::set<uid_t>& owners,
                const std::string& subject) {
    return Walk(subject.empty() ? "library " + path : subject, owners).open(path);
}

void requireTrustedFolder(const std::string& path, const std::set<uid_t>& owners,
                          const std::string& subject) {
    Walk(subject, owners).requireFolder(path);
}

}  // namespace rtcf::executor
