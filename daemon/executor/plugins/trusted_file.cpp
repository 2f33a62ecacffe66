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

#include "refusal.hpp"

namespace rtcf::executor {

namespace {

constexpr uid_t kFirstPerson = 1000;  // Debian policy 9.2.2: below are the system's own

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
    Walk(const std::string& wanted, const std::set<uid_t>& owners)
        : wanted_(wanted), owners_(owners) {}
    ~Walk() {
        if (at_ >= 0) ::close(at_);
    }
    Walk(const Walk&) = delete;
    Walk& operator=(const Walk&) = delete;

    int open() {
        std::error_code error;
        const std::filesystem::path real = std::filesystem::canonical(wanted_, error);
        if (error) refuse(error.message());
        for (auto part = real.begin(); part != real.end(); ++part) {
            const bool last = std::next(part) == real.end();
            // Links have been resolved: one that is met now was put there since.
            const int flags =
                O_NOFOLLOW | O_CLOEXEC | (last ? O_RDONLY | O_NONBLOCK : O_PATH | O_DIRECTORY);
            const int next = ::openat(at_ < 0 ? AT_FDCWD : at_, part->c_str(), flags);
            const int problem = errno;
            if (at_ >= 0) ::close(at_);
            at_ = next;
            seen_ /= *part;
            if (next < 0) refuse(fmt::format("{}: {}", seen_.string(), std::strerror(problem)));
            check(last);
        }
        return std::exchange(at_, -1);
    }

   private:
    [[noreturn]] void refuse(const std::string& why) const {
        throw Refusal(RefusalKind::FailedPrecondition, fmt::format("library {}: {}", wanted_, why));
    }

    void check(bool last) const {
        struct stat status {};
        if (::fstat(at_, &status) != 0) refuse(std::strerror(errno));
        if (last && !S_ISREG(status.st_mode)) refuse("not a regular file");
        const bool trusted = status.st_uid == 0 || owners_.count(status.st_uid) != 0;
        if (!trusted) distrust("belongs to user " + nameOf(status.st_uid), "chown root");
        // In a sticky folder only its owner moves a file: that is checked next.
        if (!last && (status.st_mode & S_ISVTX) != 0) return;
        if ((status.st_mode & S_IWOTH) != 0) distrust("can be written by everybody", "chmod o-w");
        // A group of one person (adduser(8), USERGROUPS) is that person.
        const bool own_group =
            status.st_gid == 0 || (status.st_gid == status.st_uid && status.st_uid >= kFirstPerson);
        if ((status.st_mode & S_IWGRP) != 0 && !own_group)
            distrust("can be written by its group", "chmod g-w");
    }

    [[noreturn]] void distrust(const std::string& why, const std::string& remedy) const {
        refuse(
            fmt::format("{} {}, so its code is not trusted: `{} {}`, or name the component folder "
                        "of a trusted user under path in rtcfd's settings",
                        seen_.string(), why, remedy, seen_.string()));
    }

    const std::string& wanted_;
    const std::set<uid_t>& owners_;
    std::filesystem::path seen_;
    int at_ = -1;
};

}  // namespace

int openTrusted(const std::string& path, const std::set<uid_t>& owners) {
    return Walk(path, owners).open();
}

}  // namespace rtcf::executor
