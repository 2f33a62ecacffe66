// Rejected and failed changes leave nothing behind and end nothing.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <new>
#include <random>
#include <string>
#include <vector>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

using executor::Difference;
using executor::ReplayChunk;
using executor::WantedComponent;

const std::string kUnitTest = RTCF_UNIT_COMPONENTS "/rtcf_unit_test.so";

class Rollback : public RunnerFixture {
   protected:
    ChangeOutcome apply(const std::vector<WantedComponent>& wanted) {
        return onGraphThread(
            [&] { return runner().apply(wanted, false, [](const std::string&) {}); });
    }

    static WantedComponent wanted(const std::string& type, const std::string& name) {
        ComponentDefinition component = definition(type, name);
        component.remaps = {{"in", name + "_in"}, {"out", name + "_out"}};
        return {component, kUnitTest};
    }

    ParameterValue parameter(const std::string& component, const std::string& name) {
        const auto graph = runner().graph();
        for (const auto& each : graph->get(component).parameters) {
            if (each.declaration.name == name) return each.value;
        }
        return {};
    }
};

// Its records refer to its name: they are forwarded before the name is freed.
TEST_F(Rollback, LogRecordsOfARejectedComponentAreForwarded) {
    ComponentDefinition refused = definition("Recorder", "A");
    refused.parameters = {{"refuses", std::string("prepare")}};
    EXPECT_NE(errorOf([&] { load(refused); }).find("set to refuse prepare"), std::string::npos);
    const auto entries = handedOn();
    const auto said = std::find_if(entries.begin(), entries.end(), [](const LogEntry& entry) {
        return entry.message == "refuses to prepare";
    });
    ASSERT_NE(said, entries.end()) << "the record must be forwarded before its component is freed";
    EXPECT_EQ(said->component, "/A");
}

TEST_F(Rollback, GraphWithInfiniteDefaultIsAppliedTwice) {
    EXPECT_EQ(apply({wanted("Recorder", "A")}).differences.size(), 1U);
    EXPECT_TRUE(apply({wanted("Recorder", "A")}).differences.empty());
}

TEST_F(Rollback, ParameterGoesBackToItsInfiniteDefault) {
    WantedComponent limited = wanted("Recorder", "A");
    limited.definition.parameters = {{"limit", 5.0}};
    apply({limited});
    EXPECT_EQ(parameter("/A", "limit"), ParameterValue(5.0));
    const auto differences = apply({wanted("Recorder", "A")}).differences;
    ASSERT_EQ(differences.size(), 1U);
    EXPECT_EQ(differences[0].kind, Difference::Kind::Parameters);
    EXPECT_EQ(parameter("/A", "limit"), ParameterValue(std::numeric_limits<double>::infinity()));
}

TEST_F(Rollback, OtherInfiniteValuesAreRejected) {
    load(definition("Recorder", "A"));
    const double infinity = std::numeric_limits<double>::infinity();
    EXPECT_EQ(errorOf([&] { setParameters("/A", {{"gain", infinity}}); }),
              "/A: parameter gain must be finite");
    EXPECT_EQ(errorOf([&] { setParameters("/A", {{"limit", -infinity}}); }),
              "/A: parameter limit must be finite");
}

TEST_F(Rollback, ReplayOfAGraphWithInfiniteDefaultStarts) {
    load(definition("Recorder", "A"));
    ReplayChunk chunk;
    chunk.begin = true;
    EXPECT_EQ(errorOf([&] {
                  onGraphThread([&] { return runner().replay(chunk, [](const std::string&) {}); });
              }),
              "");
}

#if !defined(__SANITIZE_ADDRESS__)  // which has to see each block

TEST_F(Rollback, AppliedComponentsLieInMemoryInTheOrderOfExecution) {
    constexpr int kCount = 40;
    const auto ports = std::make_shared<executor::TypePorts>(executor::TypePorts{{"in"}, {"out"}});
    std::vector<WantedComponent> chain;
    for (int i = 0; i < kCount; ++i) {
        chain.push_back(wanted("Recorder", "C" + std::to_string(kCount - i)));
        chain.back().ports = ports;
        chain.back().definition.remaps = {{"in", "c" + std::to_string(i)},
                                          {"out", "c" + std::to_string(i + 1)}};
    }
    std::mt19937 random(3);
    for (int round = 0; round < 5; ++round) {
        SCOPED_TRACE(round);
        std::shuffle(chain.begin(), chain.end(), random);
        apply({});
        apply(chain);
        std::vector<const Component*> places;
        for (const auto& component : runner().graph()->components)
            places.push_back(&component->instance->component());
        ASSERT_EQ(places.size(), static_cast<std::size_t>(kCount));
        int backwards = 0;
        for (int i = 1; i < kCount; ++i)
            backwards += std::less<>()(places[i], places[i - 1]) ? 1 : 0;
        EXPECT_LE(backwards, 2) << "a chunk of memory may lie before the last one";
    }
}

#endif

// For example memory that runs out during a change.
TEST_F(Rollback, AnyExceptionUndoesTheWholeChange) {
    WantedComponent writer = wanted("Touchy", "A");
    WantedComponent reader = wanted("Touchy", "B");
    reader.definition.remaps = {{"in", "A_out"}, {"out", "B_out"}};
    apply({writer, reader});
    const auto before = generation();
    writer.definition.parameters = {{"gain", 2.0}};
    reader.definition.breaks.ports = {"in"};  // requires a copy of the value
    journal().copies_throw = true;
    const bool thrown = onGraphThread([&] {
        try {
            runner().apply({writer, reader}, false, [](const std::string&) {});
        } catch (const std::bad_alloc&) {
            return true;
        }
        return false;
    });
    journal().copies_throw = false;
    EXPECT_TRUE(thrown);
    EXPECT_EQ(generation(), before);
    EXPECT_EQ(parameter("/A", "gain"), ParameterValue(1.0));
    EXPECT_EQ(apply({writer, reader}).differences.size(), 2U) << "both loads were undone";
}

// For example a value that outgrew the memory reserved by its component.
TEST_F(Rollback, NoMemoryInTheCycleEndsTheLoopInOrder) {
    WantedComponent writer = wanted("Touchy", "A");
    WantedComponent reader = wanted("Touchy", "B");
    reader.definition.remaps = {{"in", "A_out"}, {"out", "B_out"}};
    reader.definition.breaks.ports = {"in"};
    apply({writer, reader});
    start();
    ASSERT_TRUE(runs());
    journal().copies_throw = true;
    EXPECT_TRUE(eventually([this] { return state() == RunnerState::Faulted; }));
    journal().copies_throw = false;
    const auto all = events();
    EXPECT_TRUE(std::any_of(all.begin(), all.end(), [](const RunnerEvent& event) {
        return event.component == "/A" &&
               event.message.find("no memory to copy the value of an output") != std::string::npos;
    }));
}

TEST_F(Rollback, NoMemoryForAnOptionalComponentsValueTakesItOut) {
    WantedComponent writer = wanted("Touchy", "A");
    writer.definition.optional = true;
    apply({writer});
    start();
    ASSERT_TRUE(runs());
    journal().copies_throw = true;
    EXPECT_TRUE(eventually([this] {
        const auto all = events();
        return std::any_of(all.begin(), all.end(), [](const RunnerEvent& event) {
            return event.component == "/A" &&
                   event.message.find("std::bad_alloc; taken out") != std::string::npos;
        });
    }));
    EXPECT_TRUE(eventually([this] {
        const auto all = events();
        return std::any_of(all.begin(), all.end(), [](const RunnerEvent& event) {
            return event.message.find(
                       "cannot copy a value of safe(): std::bad_alloc; readers keep "
                       "the value before") != std::string::npos;
        });
    }));
    journal().copies_throw = false;
    EXPECT_TRUE(runs());
    stop();
}

// The first output's value of that cycle is already published.
TEST_F(Rollback, NoMemoryForOneOutputWithholdsNoSafeValueOfAnother) {
    WantedComponent writer{definition("Couple", "A"), kUnitTest};
    writer.definition.optional = true;
    apply({writer});
    step(2);
    ASSERT_EQ(value("/A", "command"), 5.0);
    journal().copies_throw = true;
    step(1);
    journal().copies_throw = false;
    EXPECT_EQ(value("/A", "command"), 0.0);
}

// A reader with a loop break has a copy, made before the components run.
TEST_F(Rollback, NoMemoryBeforeTheComponentsRunIsNoCycle) {
    WantedComponent writer = wanted("Touchy", "A");
    WantedComponent reader = wanted("Touchy", "B");
    reader.definition.remaps = {{"in", "A_out"}, {"out", "B_out"}};
    reader.definition.breaks.ports = {"in"};
    apply({writer, reader});
    EXPECT_EQ(step(3).cycles, 3U);
    journal().copies_throw = true;
    EXPECT_EQ(step(3).cycles, 0U);
    journal().copies_throw = false;
    EXPECT_EQ(iteration(), 3U);
    EXPECT_EQ(state(), RunnerState::Faulted);
}

TEST_F(Rollback, NoMemoryInTheLastCycleIsNoFaultOfAStop) {
    WantedComponent writer = wanted("Touchy", "A");
    WantedComponent reader = wanted("Touchy", "B");
    reader.definition.remaps = {{"in", "A_out"}, {"out", "B_out"}};
    reader.definition.breaks.ports = {"in"};
    apply({writer, reader});
    EXPECT_EQ(step(3).cycles, 3U);
    journal().copies_throw = true;
    stop();
    journal().copies_throw = false;
    EXPECT_EQ(state(), RunnerState::Stopped);
}

TEST_F(Rollback, NoExceptionInAChangeByRosEndsTheProcess) {
    load(definition("Recorder", "A"));
    start();
    loseEvents();
    std::promise<std::string> answer;
    bridge().request("/A", {{"gain", 2.0}}, executor::BatchPolicy::Whole,
                     [&](const std::string& refused) { answer.set_value(refused); });
    EXPECT_EQ(answer.get_future().get(), "");
    EXPECT_EQ(parameter("/A", "gain"), ParameterValue(2.0));
    bridge().request("/A", {{"gain", 3.0}}, executor::BatchPolicy::Whole,
                     [](const std::string&) { throw std::bad_alloc(); });
    EXPECT_TRUE(runs());
    EXPECT_EQ(stop().order, std::vector<std::string>{"/A"});
}

TEST_F(Rollback, ARejectedValueOfRosLeavesTheOthersIfRequested) {
    load(definition("Recorder", "A"));
    start();
    const auto request = [this](executor::BatchPolicy policy) {
        std::promise<std::string> answer;
        bridge().request("/A", {{"text", std::string("new")}, {"gain", 11.0}, {"limit", 5.0}},
                         policy, [&](const std::string& refused) { answer.set_value(refused); });
        return answer.get_future().get();
    };
    const std::string rejected = request(executor::BatchPolicy::Whole);
    EXPECT_NE(rejected.find("is above its maximum 10"), std::string::npos) << rejected;
    EXPECT_EQ(parameter("/A", "text"), ParameterValue(std::string("as told")));
    EXPECT_EQ(request(executor::BatchPolicy::Each), rejected);
    EXPECT_EQ(parameter("/A", "text"), ParameterValue(std::string("new")));
    EXPECT_EQ(parameter("/A", "limit"), ParameterValue(5.0));
    EXPECT_EQ(parameter("/A", "gain"), ParameterValue(1.0));
    EXPECT_TRUE(runs());
}

// With or without a report, the loop ends in order.
TEST_F(Rollback, FaultThatCannotBeReportedEndsTheLoopInOrder) {
    ComponentDefinition failing = definition("Recorder", "A");
    failing.parameters = {{"throws_at", std::int64_t{10}}};
    load(failing);
    loseEvents();
    start();
    EXPECT_TRUE(eventually([this] { return journal().count("/A stop") == 1; }));
    EXPECT_TRUE(eventually([this] { return state() == RunnerState::Faulted; }));
}

}  // namespace
}  // namespace rtcf::test
