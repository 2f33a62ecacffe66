// Introspection topics of a runner: a real runner with its loop, at a real master.
#include <future>

#include "faults/flight_recorder.hpp"
#include "ros_fixture.hpp"
#include "runner/runner.hpp"

namespace {

using rtcf::executor::Runner;

class IntrospectionTest : public RosFixture {
   protected:
    // Starts a runner whose bridge is the node.
    void startRunner() {
        runner_ = std::make_unique<Runner>(
            "rt_runner", log(), [](const rtcf::executor::RunnerEvent&) {}, makeNode(), recorder_);
        onGraphThread([this] {
            rtcf::executor::RunnerSettings settings = runner_->settings();
            settings.frequency_hz = 100.0;
            settings.loop.realtime.lock_memory = false;
            settings.loop.realtime.heap_bytes = 0;
            settings.bridge.master_uri = masterUri();
            runner_->configure(settings);
            runner_->start([](const std::string&) {});
        });
    }
    // Ends it, its loop and the node, like an executor that is asked to end.
    void endRunner() { runner_.reset(); }

   private:
    void onGraphThread(const std::function<void()>& work) {
        std::promise<void> done;
        runner_->post([&] {
            work();
            done.set_value();
        });
        done.get_future().wait();
    }

    rtcf::executor::FlightRecorder recorder_;
    std::unique_ptr<Runner> runner_;
};

TEST_F(IntrospectionTest, PublishesTheLastStateBeforeItCloses) {
    startMaster();
    startRunner();
    const auto listener = health();
    const auto hears = [&](const std::string& state) {
        return eventually([&] {
            const auto line = listener->line(1s);
            return line && line->find(": loop|" + state) != std::string::npos;
        });
    };
    ASSERT_TRUE(hears("running"));
    endRunner();
    EXPECT_TRUE(hears("stopped"));
}

}  // namespace
