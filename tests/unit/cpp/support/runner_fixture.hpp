/// @file
/// A real runner for a test, with a loop at 1 kHz and short functions for its
/// operations. Changes run on the runner's graph thread, as for the server; errors are
/// thrown here.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/error.hpp"
#include "components/journal.hpp"
#include "faults/flight_recorder.hpp"
#include "logging/log.hpp"
#include "runner/runner.hpp"
#include "support/bridge_keeper.hpp"
#include "support/eventually.hpp"

namespace rtcf::test {

using executor::ChangeOutcome;
using executor::ComponentDefinition;
using executor::Error;
using executor::LogEntry;
using executor::Runner;
using executor::RunnerEvent;
using executor::RunnerSettings;
using executor::RunnerState;

/// A component of package rtcf_unit_test; remaps and parameters are added by the caller.
ComponentDefinition definition(const std::string& type, const std::string& name);

/// The result of work on the graph thread. An error is passed on by value: libstdc++ counts the
/// owners of an exception in a way that ThreadSanitizer does not see.
template <typename Result>
struct Answer {
    std::optional<Result> result;
    std::optional<std::pair<executor::ErrorKind, std::string>> error;
};

/// Work on the graph thread that may still be running.
template <typename Result>
class Pending {
   public:
    explicit Pending(std::future<Answer<Result>> answer) : answer_(std::move(answer)) {}
    /// Waits. @throws Error
    Result get() {
        Answer<Result> answer = answer_.get();
        if (answer.error) throw Error(answer.error->first, answer.error->second);
        return std::move(*answer.result);
    }

   private:
    std::future<Answer<Result>> answer_;
};

class RunnerFixture : public ::testing::Test {
   protected:
    /// @param cpu_claims folder of CPU claims; empty = other loops are unknown
    explicit RunnerFixture(std::string cpu_claims = {});
    ~RunnerFixture() override;

    /// Runs `work` on the graph thread. @throws its exceptions
    template <typename Work>
    auto onGraphThread(Work work) -> decltype(work());

    /// Posts `work` without waiting for it.
    template <typename Work>
    auto begin(Work work) -> Pending<decltype(work())>;

    ChangeOutcome load(const ComponentDefinition& component);
    /// Loads without waiting for the end.
    Pending<ChangeOutcome> beginLoad(const ComponentDefinition& component);
    ChangeOutcome loadExample(const std::string& type, const std::string& name,
                              executor::Remaps remaps, bool first = false);
    /// Fig. 1 of the paper.
    void loadFig1();
    ChangeOutcome unload(const std::string& name);
    ChangeOutcome replace(const std::string& name, const ComponentDefinition& component);
    ChangeOutcome setBreak(const std::string& name, const std::string& port, bool broken);
    ChangeOutcome setParameters(const std::string& name,
                                const std::vector<std::pair<std::string, ParameterValue>>& batch);
    ChangeOutcome start();
    ChangeOutcome stop();
    ChangeOutcome step(std::uint64_t cycles);
    /// Changes settings, starting from the present ones.
    void configure(const std::function<void(RunnerSettings&)>& change);

    /// The error text of `work`; empty if it succeeds.
    template <typename Work>
    std::string errorOf(Work&& work);

    /// Newest value of a port with a std_msgs number. @return NaN without a value
    double value(const std::string& component, const std::string& port);
    /// Durations of the loop's cycles so far.
    const executor::CycleStatistics& durations() {
        runner_->cycleStatistics().count();
        return runner_->cycleStatistics();
    }
    std::uint64_t iteration() const { return runner_->loop().statistics().iteration.load(); }
    /// Waits until the loop has run `cycles` more. @return false at the deadline
    bool runs(std::uint64_t cycles = 20);
    RunnerState state() const { return runner_->status().state; }
    std::vector<std::string> order() const;
    std::uint64_t generation() const { return runner_->graph()->generation; }

    std::vector<RunnerEvent> events() const;
    std::vector<LogEntry> logged();
    /// The log records forwarded so far, without those still queued.
    std::vector<LogEntry> handedOn() const;
    /// From now on events are lost.
    void loseEvents() { events_are_lost_ = true; }
    rtcf_unit_test::Journal& journal() { return *rtcf_unit_test_journal(); }
    BridgeRecord& bridge() { return *bridge_; }

    /// Ends the runner, as at the end of the executor.
    void endRunner() { runner_.reset(); }

    Runner& runner() { return *runner_; }

   private:
    mutable std::mutex mutex_;
    std::vector<RunnerEvent> events_;
    std::atomic<bool> events_are_lost_{false};
    std::vector<LogEntry> logged_;
    executor::FlightRecorder recorder_;
    executor::Log log_;
    std::shared_ptr<BridgeRecord> bridge_ = std::make_shared<BridgeRecord>();
    std::unique_ptr<Runner> runner_;
};

template <typename Work>
auto RunnerFixture::begin(Work work) -> Pending<decltype(work())> {
    using Result = decltype(work());
    auto promise = std::make_shared<std::promise<Answer<Result>>>();
    Pending<Result> pending(promise->get_future());
    // Not runner_, which is null while the runner ends.
    runner_->post([&runner = *runner_, promise, work = std::move(work)] {
        Answer<Result> answer;
        try {
            answer.result = work();
        } catch (const Error& refused) {
            answer.error.emplace(refused.kind(), refused.what());
        }
        runner.cleanUpLeft();
        promise->set_value(std::move(answer));
    });
    return pending;
}

template <typename Work>
auto RunnerFixture::onGraphThread(Work work) -> decltype(work()) {
    return begin(std::move(work)).get();
}

template <typename Work>
std::string RunnerFixture::errorOf(Work&& work) {
    try {
        work();
        return {};
    } catch (const Error& refused) {
        return refused.what();
    }
}

}  // namespace rtcf::test
