// Logs each hook and, for tests without logs, also writes it to a file. And components whose
// hooks wait for the test.
#include <chrono>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>

#include <rtcf/component.hpp>

namespace {

class Witness final : public rtcf::Component {
    rtcf::Parameter<std::string> file{this, "file", "", rtcf::Doc("gets a line for each hook")};
    rtcf::Parameter<bool> throws{this, "throws", false, rtcf::Doc("update() throws")};
    bool updated_ = false;
    bool safe_ = false;

    void note(const char* hook) {
        if (!file.value().empty()) std::ofstream(file.value(), std::ios::app) << hook << '\n';
    }

    bool configure() override {
        RTCF_INFO(this, "hook {}", "configure");
        note("configure");
        return true;
    }
    bool start() override {
        RTCF_INFO(this, "hook {}", "start");
        note("start");
        return true;
    }
    void update() override {
        RTCF_INFO_ONCE(this, "hook {}", "update");
        updated_ = true;
        if (throws.value()) throw std::runtime_error("as requested");
    }
    void safe() noexcept override {
        RTCF_INFO(this, "hook {}", "safe");
        safe_ = true;
    }
    void stop() override {
        RTCF_INFO(this, "hook {}", "stop");
        // The real-time thread must not write files, so its hooks are recorded afterwards.
        if (updated_) note("update");
        if (safe_) note("safe");
        note("stop");
    }
    void cleanup() override {
        RTCF_INFO(this, "hook {}", "cleanup");
        note("cleanup");
    }
};

// Waits for a file to appear. Not real-time safe.
bool comes(const std::string& file) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (!std::filesystem::exists(file)) {
        if (std::chrono::steady_clock::now() > until) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
}

class StartsOnceThereIs final : public rtcf::Component {
    rtcf::Parameter<std::string> file{this, "file", "", rtcf::Doc("start() waits for it")};

    bool start() override {
        RTCF_INFO(this, "waits for {}", "a file");
        return comes(file.value()) || fail("it does not come");
    }
    void update() override {}
};

class ConfiguresOnceThereIs final : public rtcf::Component {
    rtcf::Parameter<std::string> file{this, "file", "", rtcf::Doc("configure() waits for it")};

    bool configure() override { return comes(file.value()) || fail("it does not come"); }
    void update() override {}
};

}  // namespace

RTCF_COMPONENT(ConfiguresOnceThereIs, "Waits in configure() for a file")
RTCF_COMPONENT(StartsOnceThereIs, "Waits in start() for a file")
RTCF_COMPONENT(Witness, "Logs each hook")
