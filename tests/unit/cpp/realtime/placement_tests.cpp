// Missing real-time conditions of a loop on its CPU.
#include <gtest/gtest.h>

#include <algorithm>

#include "realtime/cpu_claim.hpp"
#include "support/runner_fixture.hpp"
#include "support/temporary_folder.hpp"

namespace rtcf::test {
namespace {

// Constructed before the fixture, which uses it.
class ClaimsFolder {
   protected:
    TemporaryFolder temporary_;
    const std::string folder_ = temporary_.path("");
};

class Placement : protected ClaimsFolder, public RunnerFixture {
   protected:
    Placement() : RunnerFixture(folder_) {}
    bool lacks(const std::string& text) {
        const std::vector<std::string> degraded = runner().status().degraded;
        return std::any_of(degraded.begin(), degraded.end(), [&](const std::string& each) {
            return each.find(text) != std::string::npos;
        });
    }
};

TEST_F(Placement, CorrectedWhileTheLoopRunsIsReportedNoLonger) {
    if (executor::processCpus().size() < 2) GTEST_SKIP() << "one CPU";
    const int shared = executor::processCpus().back();
    const executor::CpuClaim other(shared, folder_);
    configure([&](RunnerSettings& settings) { settings.loop.realtime.cpu = shared; });
    load(definition("Ticker", "A"));
    start();
    EXPECT_TRUE(lacks("also runs another loop"));
    configure([](RunnerSettings& settings) {
        settings.loop.realtime.cpu = executor::processCpus().front();
    });
    EXPECT_FALSE(lacks("also runs another loop"));
    EXPECT_TRUE(lacks("memory is not locked")) << "as at the start";
    EXPECT_TRUE(runs());
}

}  // namespace
}  // namespace rtcf::test
