// thread_local variables of libraries linked by components: the thread of the cycles has their
// memory before the first cycle.
#include <dlfcn.h>
#include <gtest/gtest.h>

#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

const std::string kFolder = RTCF_UNIT_COMPONENTS "/";
const std::string kLate = kFolder + "linked_thread_local_late.so";

class ThreadLocals : public RunnerFixture {
   protected:
    ComponentDefinition linked(const std::string& name) {
        ComponentDefinition result = definition("LinkedThreadLocal", name);
        for (const char* port : {"had", "count"}) result.remaps.emplace_back(port, name + port);
        return result;
    }

    ChangeOutcome loadLinked(const std::string& name,
                             const std::string& library = kFolder + "linked_thread_local.so") {
        return onGraphThread(
            [&] { return runner().load(linked(name), library, [](const std::string&) {}); });
    }

    void startTicking() {
        load(definition("Ticker", "T"));
        start();
        ASSERT_TRUE(runs());
    }

    void expectMemoryFromTheFirstCycleOn(const std::string& component) {
        EXPECT_EQ(value(component, "had"), 1.0);
        EXPECT_GT(value(component, "count"), 0.0);
    }
};

TEST_F(ThreadLocals, OfLinkedLibrariesExistInTheFirstCycle) {
    loadLinked("A");
    start();
    ASSERT_TRUE(runs());
    expectMemoryFromTheFirstCycleOn("/A");
}

TEST_F(ThreadLocals, ExistInEachThreadOfTheLoop) {
    loadLinked("A");
    for (int round = 0; round < 3; ++round) {
        start();
        ASSERT_TRUE(runs());
        stop();
        expectMemoryFromTheFirstCycleOn("/A");
        unload("/A");
        loadLinked("A");
    }
}

TEST_F(ThreadLocals, ExistInTheFirstStep) {
    loadLinked("A");
    step(1);
    expectMemoryFromTheFirstCycleOn("/A");
}

TEST_F(ThreadLocals, ExistInTheStepAfterALoad) {
    load(definition("Ticker", "T"));
    step(1);
    loadLinked("A");
    step(1);
    expectMemoryFromTheFirstCycleOn("/A");
}

TEST_F(ThreadLocals, NewToTheLoopAreRejectedUntilItIsStopped) {
    startTicking();
    const auto before = order();
    const auto generation_before = generation();
    for (int round = 0; round < 2; ++round) {
        const std::string text = errorOf([this] { loadLinked("A", kLate); });
        for (const std::string& part :
             {"library " + kLate + ": ", std::string("libthread_locals_late.so"),
              std::string("thread_local"), std::string("rtcfctl -r rt_runner stop")})
            EXPECT_NE(text.find(part), std::string::npos) << text;
        EXPECT_EQ(text.find('\n'), std::string::npos) << text;
        EXPECT_EQ(order(), before);
        EXPECT_EQ(generation(), generation_before);
        EXPECT_TRUE(runs());
    }
    stop();
    loadLinked("A", kLate);
    start();
    ASSERT_TRUE(runs());
    expectMemoryFromTheFirstCycleOn("/A");
    loadLinked("B", kLate);
    ASSERT_TRUE(runs());
    expectMemoryFromTheFirstCycleOn("/B");
}

TEST_F(ThreadLocals, KnownToTheLoopLoadWhileItRuns) {
    loadLinked("A");
    start();
    ASSERT_TRUE(runs());
    unload("/A");
    loadLinked("B");
    ASSERT_TRUE(runs());
    expectMemoryFromTheFirstCycleOn("/B");
}

TEST_F(ThreadLocals, InStaticTlsLoadWhileTheLoopRuns) {
    startTicking();
    loadLinked("A", kFolder + "linked_thread_local_static.so");
    onGraphThread([this] {
        return runner().load(definition("ThreadLocal", "B"), kFolder + "thread_local_static.so",
                             [](const std::string&) {});
    });
    ASSERT_TRUE(runs());
    EXPECT_GT(value("/A", "count"), 0.0);
}

TEST_F(ThreadLocals, AreAllowedWithoutRealTime) {
    load(definition("Ticker", "T"));
    step(1);
    EXPECT_EQ(errorOf([this] { loadLinked("A", kLate); }), "");
}

// Its module number would be reused for the next library, which would seem to be known.
TEST_F(ThreadLocals, StayLoadedWhileTheLoopHasTheirMemory) {
    const std::string file = RTCF_UNIT_CLOSED_LIBRARY;
    const auto loaded = [&file] {
        void* const library = dlopen(file.c_str(), RTLD_LAZY | RTLD_NOLOAD);
        if (library != nullptr) dlclose(library);
        return library != nullptr;
    };
    void* const library = dlopen(file.c_str(), RTLD_NOW);
    ASSERT_NE(library, nullptr) << dlerror();
    startTicking();
    dlclose(library);
    EXPECT_TRUE(loaded());
    stop();
    EXPECT_FALSE(loaded());
}

}  // namespace
}  // namespace rtcf::test
