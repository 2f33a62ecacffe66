// Random changes while the loop runs, other threads query, and topics flow in and out: for
// ThreadSanitizer and AddressSanitizer, which find errors that no counter shows. The expected graph
// is a map here; tests/integration/graph/test_soak.py has the complete model.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <map>
#include <random>
#include <thread>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

#ifdef RTCF_SANITIZED
constexpr int kChanges = 150;
#else
constexpr int kChanges = 1000;
#endif
constexpr int kNames = 6;
const std::string kLibrary = RTCF_UNIT_COMPONENTS "/rtcf_unit_test.so";

class Soak : public RunnerFixture {
   protected:
    using Wanted = std::map<std::string, ComponentDefinition>;

    ~Soak() override { endHelpers(); }

    int chance(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }

    // Reads a topic with which it may close a loop, or none.
    ComponentDefinition randomComponent(const std::string& name) {
        ComponentDefinition result = definition(chance(3) == 0 ? "Relay" : "Recorder", name);
        const std::string topic(1, static_cast<char>('A' + chance(kNames + 2)));
        result.remaps = {
            {"in", topic + "_out"}, {"out", name + "_out"}, {"status", name + "_status"}};
        if (chance(2) == 0) result.breaks.ports = {"in"};
        result.breaks.first = chance(6) == 0;
        result.every = std::array<std::uint32_t, 4>{1, 1, 2, 4}[static_cast<unsigned>(chance(4))];
        if (result.type == "Recorder" && chance(8) == 0)
            result.parameters = {{"refuses", std::string(chance(2) == 0 ? "configure" : "start")}};
        return result;
    }

    // Works on a copy of the expected graph, which applies unless the change fails.
    void changeSomething() {
        Wanted next = wanted_;
        const std::string name(1, static_cast<char>('B' + chance(kNames)));
        const bool there = wanted_.count(name) != 0;
        const ComponentDefinition component = randomComponent(name);
        const std::vector<std::string> order_before = order();
        const std::uint64_t generation_before = generation();
        const std::string why = errorOf([&] {
            switch (chance(8)) {
                case 0:
                    unload("/" + name);
                    next.erase(name);
                    break;
                case 1:
                    setBreak("/" + name, "in", chance(2) == 0);
                    break;
                case 2:
                    setParameters("/" + name, {{"gain", static_cast<double>(chance(12))}});
                    break;
                case 3:
                    apply(next);
                    break;
                case 4:
                    (void)value("/" + name, "out");
                    break;
                case 5:
                    configure([this](RunnerSettings& settings) {
                        settings.whitelist = chance(3) == 0 ? "/A_out" : ".*";
                        settings.frequency_hz = chance(2) == 0 ? 1000.0 : 2000.0;
                    });
                    break;
                default:
                    if (there) {
                        replace("/" + name, component);
                    } else {
                        load(component);
                    }
                    next[name] = component;
            }
        });
        if (!why.empty()) {
            ++rejections_;
            ASSERT_EQ(order(), order_before) << why;
            ASSERT_EQ(generation(), generation_before) << why;
            return;
        }
        wanted_ = std::move(next);
        std::vector<std::string> names = order();
        std::sort(names.begin(), names.end());
        std::vector<std::string> expected{"/A"};
        for (const auto& [each, definition_of_each] : wanted_) expected.push_back("/" + each);
        ASSERT_EQ(names, expected);
    }

    // Some components are removed, some added, some stay.
    void apply(Wanted& next) {
        std::vector<executor::WantedComponent> components{{steady(), kLibrary}};
        for (int i = 0; i < 2; ++i) {
            const std::string name(1, static_cast<char>('B' + chance(kNames)));
            if (chance(2) == 0) {
                next.erase(name);
            } else {
                next[name] = randomComponent(name);
            }
        }
        for (const auto& [name, component] : next) components.push_back({component, kLibrary});
        const bool look = chance(4) == 0;
        onGraphThread([&] { return runner().apply(components, look, [](const std::string&) {}); });
        if (look) next = wanted_;
    }

    static ComponentDefinition steady() {
        ComponentDefinition result = definition("Recorder", "A");
        result.remaps = {{"in", "A_in"}, {"out", "A_out"}};
        return result;
    }

    // The continuous work of the server's, the log's and the ROS node's threads.
    void startHelpers() {
        helpers_.emplace_back([this] {
            while (!over_.load()) {
                const auto graph = runner().graph();
                for (const auto& component : graph->components)
                    (void)component->statistics->duration.snapshot();
                (void)durations().duration().snapshot();
                (void)runner().status();
                (void)runner().recorder().runningHook();
                std::this_thread::yield();
            }
        });
        helpers_.emplace_back([this] {
            while (!over_.load()) {
                for (int i = 0; i < kNames + 2; ++i) exchange(static_cast<char>('A' + i));
                (void)logged();
                std::this_thread::yield();
            }
        });
    }

    void exchange(char letter) {
        const std::string topic = std::string("/") + letter + "_out";
        if (const auto tap = bridge().tap(topic)) {
            while (
                tap->pop([this](const std::uint8_t*, std::uint32_t, std::int64_t) { ++taken_; })) {
            }
        }
        if (const auto injector = bridge().injector(topic)) {
            const double number = letter;
            std::array<std::uint8_t, sizeof number> bytes{};
            std::memcpy(bytes.data(), &number, sizeof number);
            injector->deliver(bytes.data(), sizeof number);
        }
    }

    void endHelpers() {
        over_.store(true);
        for (std::thread& helper : helpers_) helper.join();
        helpers_.clear();
    }

    std::mt19937 random_{7};
    Wanted wanted_;
    int rejections_ = 0;
    std::atomic<int> taken_{0};

   private:
    std::atomic<bool> over_{false};
    std::vector<std::thread> helpers_;
};

TEST_F(Soak, RandomChangesCauseNoRace) {
    load(steady());
    start();
    ASSERT_TRUE(runs());
    startHelpers();
    for (int i = 0; i < kChanges; ++i) {
        changeSomething();
        ASSERT_FALSE(HasFatalFailure()) << "change " << i;
        ASSERT_EQ(state(), RunnerState::Running) << "change " << i;
    }
    EXPECT_TRUE(eventually([this] { return taken_.load() > 0; }));
    endHelpers();
    stop();
    EXPECT_EQ(value("/A", "out"), static_cast<double>(iteration()))
        << "unchanged components are updated in each cycle";
    EXPECT_GT(rejections_, kChanges / 20);
    EXPECT_LT(rejections_, kChanges * 3 / 4);
}

}  // namespace
}  // namespace rtcf::test
