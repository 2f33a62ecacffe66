#include "realtime/cpu_claim.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <filesystem>
#include <future>
#include <memory>
#include <set>
#include <string>

#include "support/temporary_folder.hpp"

namespace rtcf::test {
namespace {

using namespace executor;

class CpuClaimTest : public ::testing::Test {
   protected:
    void SetUp() override { ASSERT_TRUE(std::filesystem::create_directory(names())); }
    std::string names() const { return folder_.path("claims"); }
    std::set<std::string> files() const {
        std::set<std::string> found;
        for (const auto& file : std::filesystem::directory_iterator(names()))
            found.insert(file.path().filename());
        return found;
    }

   private:
    TemporaryFolder folder_;
};

TEST_F(CpuClaimTest, SpreadsLoopsOverTheCpus) {
    std::vector<std::unique_ptr<CpuClaim>> loops;
    std::set<int> taken;
    for (std::size_t i = 0; i < processCpus().size(); ++i) {
        loops.push_back(std::make_unique<CpuClaim>(-1, names()));
        EXPECT_TRUE(loops.back()->alone());
        taken.insert(loops.back()->cpu());
    }
    EXPECT_EQ(taken.size(), loops.size());
    EXPECT_EQ(loops.front()->cpu(), processCpus().back()) << "the first loop gets the last CPU";
    // And again, a second loop for each.
    taken.clear();
    for (std::size_t i = 0; i < processCpus().size(); ++i) {
        loops.push_back(std::make_unique<CpuClaim>(-1, names()));
        EXPECT_FALSE(loops.back()->alone());
        taken.insert(loops.back()->cpu());
    }
    EXPECT_EQ(taken.size(), processCpus().size());
    // The CPU of an ended loop has the fewest.
    const int left = loops.back()->cpu();
    loops.pop_back();
    EXPECT_EQ(CpuClaim(-1, names()).cpu(), left);
}

TEST_F(CpuClaimTest, PrefersIsolatedCpusAndThenTheLast) {
    const std::vector<int> cpus{0, 1, 2, 3, 5, 12};
    using Order = std::vector<int>;
    EXPECT_EQ(byPreference(cpus, ""), (Order{12, 5, 3, 2, 1, 0}));
    EXPECT_EQ(byPreference(cpus, "1-2"), (Order{2, 1, 12, 5, 3, 0}));
    EXPECT_EQ(byPreference(cpus, "0,4-5,7"), (Order{5, 0, 12, 3, 2, 1}));
    EXPECT_EQ(byPreference(cpus, "2,"), (Order{2, 12, 5, 3, 1, 0}));
    EXPECT_EQ(byPreference(cpus, "(null)"), (Order{12, 5, 3, 2, 1, 0}));
    EXPECT_TRUE(byPreference({}, "1").empty());
}

TEST_F(CpuClaimTest, IsFreeAfterItsEnd) {
    const int last = processCpus().back();
    {
        const CpuClaim loop(-1, names());
    }
    const CpuClaim next(-1, names());
    EXPECT_EQ(next.cpu(), last);
    EXPECT_TRUE(next.alone());
    const CpuClaim chosen(last, names());
    EXPECT_EQ(chosen.cpu(), last);
    EXPECT_FALSE(chosen.alone()) << "it uses its configured CPU, and sees the other loop";
}

TEST_F(CpuClaimTest, LeavesNoFileBehind) {
    const int last = processCpus().back();
    {
        const CpuClaim first(last, names());
        const CpuClaim second(last, names());
        const std::string name = "cpu-" + std::to_string(last);
        EXPECT_EQ(files(), (std::set<std::string>{name, name + "-1"}));
    }
    EXPECT_TRUE(files().empty());
}

TEST_F(CpuClaimTest, OfAKilledProcessIsFreeAgain) {
    const int last = processCpus().back();
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        const CpuClaim loop(last, names());
        ::raise(SIGKILL);
    }
    ASSERT_EQ(::waitpid(child, nullptr, 0), child);
    EXPECT_EQ(files().size(), 1U) << "its claim file exists";
    EXPECT_TRUE(CpuClaim(last, names()).alone());
}

TEST_F(CpuClaimTest, CannotBeHeldByAnotherUser) {
    const CpuClaim loop(-1, names());
    const auto file = *std::filesystem::directory_iterator(names());
    struct stat found{};
    ASSERT_EQ(::stat(file.path().c_str(), &found), 0);
    EXPECT_EQ(found.st_mode & 0777U, 0600U);
    // Nor by a file in its place.
    const int last = processCpus().back();
    const std::string other = names() + "/cpu-" + std::to_string(last) + "-1";
    ASSERT_EQ(::symlink(file.path().c_str(), other.c_str()), 0);
    EXPECT_EQ(CpuClaim(last, names()).cpu(), last);
    EXPECT_EQ(files().count("cpu-" + std::to_string(last) + "-2"), 0U) << "the claim is free";
}

TEST_F(CpuClaimTest, WithoutAFolderSeesNoOtherLoops) {
    for (const std::string& folder : {std::string(), names() + "/none"}) {
        const CpuClaim first(-1, folder);
        const CpuClaim second(-1, folder);
        EXPECT_EQ(first.cpu(), processCpus().back());
        EXPECT_EQ(second.cpu(), first.cpu());
        EXPECT_TRUE(second.alone());
    }
}

TEST_F(CpuClaimTest, OfManyProcessesIsHeldByOneAtATime) {
    constexpr int kProcesses = 4;
    constexpr int kClaims = 500;
    constexpr int kNever = 2;  // exit status of a process that was never alone
    const int last = processCpus().back();
    // The only holder creates a file that must not exist.
    const std::string mark = names() + "/alone";
    std::array<pid_t, kProcesses> children{};
    for (pid_t& child : children) {
        child = ::fork();
        ASSERT_GE(child, 0);
        if (child != 0) continue;
        int alone = 0;
        for (int i = 0; i < kClaims; ++i) {
            const CpuClaim claim(last, names());
            if (!claim.alone()) continue;
            ++alone;
            const int fd = ::open(mark.c_str(), O_CREAT | O_EXCL | O_RDWR, 0600);
            if (fd < 0) ::_exit(1);
            ::close(fd);
            ::unlink(mark.c_str());
        }
        ::_exit(alone > 0 ? 0 : kNever);
    }
    bool any = false;
    for (const pid_t child : children) {
        int status = 0;
        ASSERT_EQ(::waitpid(child, &status, 0), child);
        ASSERT_TRUE(WIFEXITED(status));
        // A process may be late each time.
        EXPECT_TRUE(WEXITSTATUS(status) == 0 || WEXITSTATUS(status) == kNever);
        any = any || WEXITSTATUS(status) == 0;
    }
    EXPECT_TRUE(any);
    EXPECT_TRUE(files().empty());
}

}  // namespace
}  // namespace rtcf::test
