// Records every call of its hooks, and fails on demand.
#include <std_msgs/Float64.h>

#include <chrono>
#include <limits>
#include <rtcf/component.hpp>
#include <stdexcept>
#include <string>
#include <thread>

#include "journal.hpp"

namespace {

class Recorder : public rtcf::Component {
   protected:
    rtcf::Input<std_msgs::Float64> in{this, "in"};
    rtcf::Output<std_msgs::Float64> out{this, "out"};
    rtcf::Parameter<std::string> refuses{this, "refuses", "", rtcf::Doc("hook that returns false")};
    rtcf::Parameter<std::string> throws{this, "throws", "", rtcf::Doc("hook that throws")};
    rtcf::Parameter<std::int64_t> throws_at{this, "throws_at", -1,
                                            rtcf::Doc("update, from 0, that throws")};
    rtcf::Parameter<std::string> text{this, "text", "as told", rtcf::Doc("of its exceptions")};
    rtcf::Parameter<double> gain{this, "gain", 1.0, rtcf::Min(0.0), rtcf::Max(10.0)};

    rtcf::Parameter<double> limit{this, "limit", std::numeric_limits<double>::infinity()};
    rtcf::Parameter<std::string> device{this, "device", "none", rtcf::Fixed()};

    bool prepare(const rtcf::Values& proposed) override {
        if (proposed[refuses] != "prepare") return true;
        RTCF_WARN(this, "refuses to prepare");
        return fail("set to refuse prepare");
    }
    bool configure() override { return hook("configure"); }
    bool start() override { return hook("start"); }
    void stop() override { hook("stop"); }
    void cleanup() override { hook("cleanup"); }

    // Its output counts its updates, which shows whether its state was kept.
    void update() override {
        if (static_cast<std::int64_t>(count_) == throws_at) throw std::runtime_error(text);
        if (count_ == 0.0) note("update");
        in.read();
        count_ += 1.0;
        out.value().data = count_ * gain;
        out.publish();
    }

    void safe() noexcept override { note("safe"); }

    void takeOver(const rtcf::Predecessor&) noexcept override { note("takeOver"); }

    void note(const char* what) const noexcept {
        if (rtcf_unit_test_journal != nullptr) rtcf_unit_test_journal()->note(fullName(), what);
    }

    bool hook(const char* name) {
        note(name);
        if (throws.value() == name) throw std::runtime_error(text);
        return refuses.value() != name || fail("set to refuse {}", name);
    }

   private:
    rtcf::State<double> count_{this, "count", 0.0, rtcf::Doc("updates so far")};
};

// The hook named by its parameter waits until the test opens the journal's gate.
class Blocker final : public Recorder {
   public:
    ~Blocker() override { pass("destructor"); }

   private:
    rtcf::Parameter<std::string> blocks{this, "blocks", "configure"};

    bool prepare(const rtcf::Values& proposed) override {
        return Recorder::prepare(proposed) && pass("prepare");
    }
    bool configure() override { return Recorder::configure() && pass("configure"); }
    bool start() override { return Recorder::start() && pass("start"); }
    void stop() override {
        Recorder::stop();
        pass("stop");
    }
    void cleanup() override {
        Recorder::cleanup();
        pass("cleanup");
    }

    bool pass(const char* name) {
        while (blocks.value() == name && !rtcf_unit_test_journal()->gate_open.load()) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        return true;
    }
};

}  // namespace

RTCF_COMPONENT(Recorder, "Records its hooks in the test's journal")
RTCF_COMPONENT(Blocker, "Has a hook that waits for the test")
