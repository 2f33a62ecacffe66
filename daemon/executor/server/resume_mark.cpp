#include "server/resume_mark.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <thread>
#include <utility>

namespace rtcf::executor {

namespace {

constexpr std::chrono::milliseconds kLongestWait{300};  // for the disk in the destructor

// Removes the file; works on a full disk, too.
// @return the error; empty = none
std::string unlinked(const std::string& path) {
    if (::unlink(path.c_str()) == 0 || errno == ENOENT || errno == ENOTDIR) return {};
    const int error = errno;
    struct stat found{};
    // Only a regular file is a mark.
    if (::lstat(path.c_str(), &found) == 0 && !S_ISREG(found.st_mode)) return {};
    return std::strerror(error);  // safe in glibc
}

void syncFolderOf(const std::string& path) {
    const std::string folder = path.substr(0, path.rfind('/') + 1);
    const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) return;
    ::fsync(fd);
    ::close(fd);
}

}  // namespace

// Shared with the thread, which may outlive the mark in a call that does not return.
struct ResumeMark::Shared {
    explicit Shared(std::string of) : path(std::move(of)) {}

    void threadMain();

    const std::string path;
    std::mutex mutex;
    std::condition_variable wake;
    std::condition_variable removed;
    std::uint64_t asked = 0;
    std::uint64_t done = 0;
    std::string problem;
    bool ending = false;
};

void ResumeMark::Shared::threadMain() {
    pthread_setname_np(pthread_self(), "rtcf-mark");
    std::unique_lock<std::mutex> lock(mutex);
    for (;;) {
        wake.wait(lock, [this] { return ending || asked != done; });
        if (asked == done) return;
        const std::uint64_t now = asked;
        lock.unlock();
        std::string found = unlinked(path);
        lock.lock();
        done = now;
        problem = std::move(found);
        removed.notify_all();
        if (!problem.empty() || asked != done) continue;
        lock.unlock();
        // After the answer, so that a busy disk does not delay "stopped".
        syncFolderOf(path);
        lock.lock();
    }
}

ResumeMark::ResumeMark(std::string path) {
    if (path.empty()) return;
    shared_ = std::make_shared<Shared>(std::move(path));
    // Detached, because the destructor cannot wait for a call that does not return.
    std::thread([shared = shared_] { shared->threadMain(); }).detach();
}

ResumeMark::~ResumeMark() {
    if (!shared_) return;
    std::unique_lock<std::mutex> lock(shared_->mutex);
    shared_->removed.wait_for(lock, kLongestWait,
                              [this] { return shared_->asked == shared_->done; });
    shared_->ending = true;
    shared_->wake.notify_one();
}

void ResumeMark::remove() {
    if (!shared_) return;
    const std::lock_guard<std::mutex> lock(shared_->mutex);
    ++shared_->asked;
    shared_->wake.notify_one();
}

ResumeMark::Removal ResumeMark::last() const {
    if (!shared_) return {};
    const std::lock_guard<std::mutex> lock(shared_->mutex);
    if (shared_->asked != shared_->done) return {false, {}};
    return {true, shared_->problem};
}

}  // namespace rtcf::executor
