// Snapshots of a runner: a restored one continues with the same bits; unsuitable ones are rejected.
#include "snapshot/snapshot.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "messages/snapshot_file.hpp"
#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

using executor::Snapshot;
using executor::snapshotFromFile;
using executor::snapshotToFile;

#ifdef RTCF_SANITIZED
constexpr std::uint64_t kMany = 1'000;  // cycles
#else
constexpr std::uint64_t kMany = 10'000;
#endif

class Snapshots : public RunnerFixture {
   protected:
    static ComponentDefinition chaos(const std::string& name, const std::string& a,
                                     const std::string& b) {
        ComponentDefinition result = definition("Chaos", name);
        for (const char* port : {"x", "checked", "turned", "listed", "low", "high"})
            result.remaps.emplace_back(port, "/" + name + "_" + port);
        result.remaps.emplace_back("a", "/" + a);
        result.remaps.emplace_back("b", "/" + b);
        result.remaps.emplace_back("frame", "/" + a.substr(0, a.find('_')) + "_turned");
        result.remaps.emplace_back("list", "/" + b.substr(0, b.find('_')) + "_listed");
        return result;
    }

    // Four components in a ring with loop breaks of both kinds, some of which skip cycles.
    void loadRing() {
        ComponentDefinition p = chaos("P", "S_x", "R_checked");
        p.breaks.first = true;
        load(p);
        ComponentDefinition q = chaos("Q", "P_x", "P_checked");
        q.every = 2;
        load(q);
        ComponentDefinition r = chaos("R", "Q_checked", "P_x");
        r.breaks.ports = {"b", "list"};
        r.every = 4;
        load(r);
        load(chaos("S", "R_x", "Q_checked"));
    }

    Snapshot take() {
        return onGraphThread([&] { return runner().takeSnapshot().snapshot; });
    }
    ChangeOutcome restore(const Snapshot& snapshot) {
        return onGraphThread([&] { return runner().restore(snapshot, [](const std::string&) {}); });
    }
    // The whole snapshot, except the time at which it was taken.
    static std::string bytesOf(Snapshot snapshot) {
        snapshot.taken_ns = 0;
        return snapshotToFile(snapshot);
    }
    std::string now() { return bytesOf(take()); }

    void ask(std::uint64_t cycle) {
        for (const char* name : {"/P", "/Q", "/R", "/S"})
            setParameters(name, {{"ask", static_cast<std::int64_t>(cycle)}});
    }
    // The components' digests at an earlier cycle.
    std::vector<double> digestsAt(std::uint64_t cycle) {
        ask(cycle);
        EXPECT_TRUE(runs(9));
        std::vector<double> digests;
        for (const char* name : {"/P", "/Q", "/R", "/S"}) {
            digests.push_back(value(name, "low"));
            digests.push_back(value(name, "high"));
        }
        ask(UINT64_MAX);
        return digests;
    }
    bool reaches(std::uint64_t cycle) {
        return eventually([&] { return iteration() >= cycle; });
    }

    // Checks that it is rejected with these words, and changes nothing.
    void expectRefused(const Snapshot& snapshot, const std::string& words) {
        const std::string before = now();
        const std::string text = errorOf([&] { restore(snapshot); });
        EXPECT_NE(text.find(words), std::string::npos) << text;
        EXPECT_EQ(now(), before);
    }
};

TEST_F(Snapshots, RestoredStepsContinueWithTheSameBits) {
    loadRing();
    for (const char* name : {"/P", "/Q", "/R", "/S"}) setParameters(name, {{"timed", true}});
    step(123);
    const Snapshot snapshot = snapshotFromFile(snapshotToFile(take()));
    const std::string begin = now();
    step(kMany);
    const std::string end = now();
    EXPECT_NE(begin, end);
    restore(snapshot);
    EXPECT_EQ(now(), begin);
    step(kMany);
    EXPECT_EQ(now(), end);
}

TEST_F(Snapshots, RestoredLoopContinuesWithTheSameBits) {
    configure([](RunnerSettings& settings) {
        settings.frequency_hz = 4000.0;
        settings.loop.period_ns = 250'000;
    });
    loadRing();
    start();
    ASSERT_TRUE(runs());
    const Snapshot snapshot = take();
    const std::uint64_t last = snapshot.clock.iteration + kMany;
    ASSERT_TRUE(reaches(last + 1));
    const auto first = digestsAt(last);
    restore(snapshot);
    ASSERT_LT(iteration(), last);
    ASSERT_TRUE(reaches(last + 1));
    EXPECT_EQ(digestsAt(last), first);
    EXPECT_NE(digestsAt(last - 1), first);
    EXPECT_EQ(state(), RunnerState::Running);
}

TEST_F(Snapshots, OfARunningLoopCanBeStepped) {
    loadRing();
    start();
    ASSERT_TRUE(runs());
    const Snapshot snapshot = take();
    stop();
    restore(snapshot);
    EXPECT_EQ(state(), RunnerState::Stepping);
    EXPECT_EQ(now(), bytesOf(snapshot));
    step(kMany);
    const std::string end = now();
    restore(snapshot);
    step(kMany);
    EXPECT_EQ(now(), end);
}

TEST_F(Snapshots, FitsAnotherRunnerWithTheSameGraph) {
    loadRing();
    step(100);
    const Snapshot snapshot = take();
    step(kMany);
    const std::string end = now();
    for (const char* name : {"/S", "/R", "/Q", "/P"}) unload(name);
    stop();
    // Other connections first, other phases, parameters and values.
    load(chaos("S", "Q_checked", "Q_checked"));
    ComponentDefinition r = chaos("R", "Q_checked", "P_x");
    r.every = 4;
    r.breaks.ports = {"b", "list"};
    load(r);
    ComponentDefinition q = chaos("Q", "P_x", "P_checked");
    q.every = 2;
    load(q);
    ComponentDefinition p = chaos("P", "S_x", "R_checked");
    p.breaks.first = true;
    p.parameters = {{"rate", 3.7}};
    load(p);
    step(17);
    replace("/S", chaos("S", "R_x", "Q_checked"));
    setParameters("/Q", {{"rate", 3.8}});
    step(3);
    restore(snapshot);
    step(kMany);
    EXPECT_EQ(now(), end);
}

// The value of an input from an unloaded writer, or from a connection that it no longer reads.
TEST_F(Snapshots, KeepsInputValuesOfEarlierWriters) {
    load(chaos("P", "Q_x", "Q_x"));
    setBreak("/P", "a", true);
    setBreak("/P", "b", true);
    setBreak("/P", "frame", true);
    setBreak("/P", "list", true);
    load(chaos("Q", "P_x", "P_checked"));
    load(chaos("R", "Q_x", "P_x"));
    step(50);
    unload("/Q");
    step(3);
    ComponentDefinition late = chaos("Q", "P_x", "P_checked");
    late.every = 7;
    late.phase = 5;
    load(late);  // P and R keep the first Q's value until this one writes
    const Snapshot with_kept = take();
    step(kMany);
    const std::string end = now();
    restore(with_kept);
    EXPECT_EQ(now(), bytesOf(with_kept));
    step(kMany);
    EXPECT_EQ(now(), end);
    unload("/Q");
    const Snapshot with_left = take();
    step(kMany);
    const std::string alone = now();
    restore(with_left);
    step(kMany);
    EXPECT_EQ(now(), alone);
    replace("/R", chaos("R", "Q_x", "P_x"));
    restore(with_left);
    step(kMany);
    EXPECT_EQ(now(), alone) << "also for inputs that never had a writer";
}

TEST_F(Snapshots, HasTheLastValueFromOutside) {
    configure([](RunnerSettings& settings) { settings.whitelist = "/outside"; });
    ComponentDefinition p = chaos("P", "outside", "P_x");
    p.breaks.first = true;
    load(p);
    const auto send = [&](double number) {
        std::uint8_t bytes[sizeof number];
        std::memcpy(bytes, &number, sizeof number);
        bridge().injector("/outside")->deliver(bytes, sizeof bytes);
    };
    send(0.25);
    step(3);
    const Snapshot snapshot = take();
    step(100);
    const std::string end = now();
    send(0.75);
    step(5);
    restore(snapshot);
    EXPECT_EQ(now(), bytesOf(snapshot));
    step(100);
    EXPECT_EQ(now(), end);
}

TEST_F(Snapshots, RestoresParameters) {
    loadRing();
    setParameters("/P", {{"rate", 3.75}});
    const Snapshot snapshot = take();
    setParameters("/P", {{"rate", 3.99}});
    setParameters("/S", {{"rate", 3.99}});
    restore(snapshot);
    const auto rate = [&](const std::string& name) {
        const auto graph = runner().graph();
        for (const auto& parameter : graph->get(name).parameters) {
            if (parameter.declaration.name == "rate") return std::get<double>(parameter.value);
        }
        return 0.0;
    };
    EXPECT_EQ(rate("/P"), 3.75);
    EXPECT_EQ(rate("/S"), 3.9);
}

TEST_F(Snapshots, UnsuitableOneIsRejectedCompletely) {
    loadRing();
    step(50);
    const Snapshot snapshot = take();
    step(7);
    const auto changed = [&](const std::function<void(Snapshot&)>& change) {
        Snapshot other = snapshot;
        change(other);
        return other;
    };
    const auto expect = [&](const std::string& words,
                            const std::function<void(Snapshot&)>& change) {
        expectRefused(changed(change), words);
    };
    expect("component /P is not in the snapshot",
           [](Snapshot& other) { other.components.erase(other.components.begin()); });
    expect("the graph has no component /X",
           [](Snapshot& other) { other.components[0].name = "/X"; });
    expect("a component is in the snapshot twice",
           [](Snapshot& other) { other.components.push_back(other.components[0]); });
    expect("/P was a Wave and is a Chaos",
           [](Snapshot& other) { other.components[0].type = "Wave"; });
    expect("ran every 4 cycles and runs every 1",
           [](Snapshot& other) { other.components[0].every = 4; });
    expect("state /P.value was int and is double", [](Snapshot& other) {
        other.components[0].states[0].type = "int";
        ++other.components[0].states[0].identity;
    });
    expect("state /P.digest is not in the snapshot",
           [](Snapshot& other) { other.components[0].states[1].name = "other"; });
    expect("the graph has no state /P.other",
           [](Snapshot& other) { other.components[0].states[1].name = "other"; });
    expect("state /P.past was",
           [](Snapshot& other) { other.components[0].states[2].bytes.pop_back(); });
    expect("output /P.x was float and is double",
           [](Snapshot& other) { other.components[0].outputs[0].type.name = "float"; });
    expect("output /P.checked is",
           [](Snapshot& other) { other.components[0].outputs[1].staged.reset(); });
    expect("the value of /P.x is not of type",
           [](Snapshot& other) { other.components[0].outputs[0].value.bytes += 'x'; });
    expect("the value of /P.listed is not of type",
           [](Snapshot& other) { other.components[0].outputs[3].value.bytes = "\xff"; });
    expect("input /P.a read /Q.x and reads /S.x",
           [](Snapshot& other) { other.components[0].inputs[0].source = "/Q.x"; });
    expect("input /P.a read nothing",
           [](Snapshot& other) { other.components[0].inputs[0].source.clear(); });
    expect("the graph has no parameter /P.gain",
           [](Snapshot& other) { other.components[0].parameters[0].first = "gain"; });
    expect("above its maximum",
           [](Snapshot& other) { other.components[0].parameters[0].second = 5.0; });
    expect("topic /t", [](Snapshot& other) { other.topics.push_back({"/t", {}, 1, {}}); });
    for (const std::int64_t time : {INT64_MAX, INT64_MIN}) {
        expect("/P.x has the time " + std::to_string(time),
               [&](Snapshot& other) { other.components[0].outputs[0].value.stamp = time; });
        expect("has the time " + std::to_string(time),
               [&](Snapshot& other) { other.components[0].inputs[0].seen = time; });
    }
    expect("taken at 500 Hz", [](Snapshot& other) { other.period_ns = 2'000'000; });
    expect("and 3 more", [](Snapshot& other) {
        for (auto& component : other.components) component.name += "x";
    });
    setBreak("/S", "a", true);
    expectRefused(snapshot, "input /S.a read /R.x and reads /R.x one cycle late");
}

TEST_F(Snapshots, OfAnotherBuildFitsByNameAndType) {
    const auto loadVersion = [&](int number) {
        const std::string file = RTCF_UNIT_COMPONENTS "/stateful_" + std::to_string(number) + ".so";
        onGraphThread([&] {
            return runner().load(definition("Stateful", "A"), file, [](const std::string&) {});
        });
    };
    loadVersion(1);
    step(10);
    const Snapshot snapshot = take();
    unload("/A");
    loadVersion(2);
    const std::string text = errorOf([&] { restore(snapshot); });
    for (const char* words :
         {"state /A.fresh is not in the snapshot", "state /A.gain was float and is double",
          "the graph has no state /A.old_name"})
        EXPECT_NE(text.find(words), std::string::npos) << text;
    unload("/A");
    loadVersion(1);
    restore(snapshot);
    step(1);
    EXPECT_EQ(value("/A", "out"), 11.0);
}

TEST_F(Snapshots, TooLargeForACycleIsRejectedWithTheLimit) {
    load(definition("Camera", "C"));
    const Snapshot snapshot = take();
    start();
    ASSERT_TRUE(runs());
    for (const auto& work :
         std::vector<std::function<void()>>{[&] { take(); }, [&] { restore(snapshot); }}) {
        const std::string text = errorOf(work);
        EXPECT_NE(text.find("touches 2097"), std::string::npos) << text;
        EXPECT_NE(text.find("limit is 131072 at 1000 Hz"), std::string::npos) << text;
    }
    EXPECT_EQ(state(), RunnerState::Running);
    stop();
    restore(snapshot);
}

TEST_F(Snapshots, LargerThanReservedIsRejectedInTheCycle) {
    loadRing();
    Snapshot snapshot = take();
    snapshot.components[0].outputs[3].value.bytes =
        std::string(8, '\0') + '\x9' + std::string(3, '\0') + std::string(72, '\1');
    start();
    ASSERT_TRUE(runs());
    const std::string text = errorOf([&] { restore(snapshot); });
    EXPECT_NE(text.find("the value of /P.listed has 84 bytes, its component has reserved 44"),
              std::string::npos)
        << text;
    stop();
    restore(snapshot);
}

TEST_F(Snapshots, OfATakenOutComponentIsRejected) {
    loadRing();
    const Snapshot before = take();
    ComponentDefinition throwing = definition("Controller", "C");
    throwing.optional = true;
    throwing.parameters = {{"throws_at", std::int64_t{3}}};
    load(throwing);
    const Snapshot sound = take();
    step(10);
    EXPECT_NE(errorOf([&] { take(); }).find("/C was taken out after a fault"), std::string::npos);
    EXPECT_NE(errorOf([&] { restore(sound); }).find("/C was taken out after a fault"),
              std::string::npos);
    unload("/C");
    restore(before);
}

// A late cycle has a larger elapsed(); the steps after it do not.
TEST_F(Snapshots, AfterAMissedCycleStepsHaveOnePeriodEach) {
    load(definition("Spinner", "S"));
    step(5);
    Snapshot snapshot = take();
    snapshot.clock.elapsed_ns = 3 * snapshot.period_ns;  // as in a loop that just missed two
    const double before = value("/S", "periods");
    restore(snapshot);
    step(11);
    EXPECT_EQ(value("/S", "periods"), before + 3.0 + 10.0);
}

// A removed topic leaves its last value in the input, and in the snapshot.
TEST_F(Snapshots, KeepsTheLastValueOfARemovedTopic) {
    configure([](RunnerSettings& settings) { settings.whitelist = "/outside"; });
    ComponentDefinition relay = definition("Relay", "P");
    relay.remaps = {{"in", "/outside"}};
    load(relay);
    const double number = 0.25;
    std::uint8_t bytes[sizeof number];
    std::memcpy(bytes, &number, sizeof number);
    bridge().injector("/outside")->deliver(bytes, sizeof bytes);
    step(3);
    configure([](RunnerSettings& settings) { settings.whitelist = ""; });
    step(1);
    ASSERT_EQ(value("/P", "out"), 1.25);
    const Snapshot snapshot = take();
    const auto expectOld = [&](const char* where) {
        restore(snapshot);
        step(1);
        EXPECT_EQ(value("/P", "out"), 1.25) << where;
        EXPECT_EQ(value("/P", "status"), static_cast<double>(DataStatus::Old)) << where;
    };
    expectOld("in the runner that it was taken of");
    replace("/P", relay);
    expectOld("in an input that never had a writer");
}

// For AddressSanitizer: the next change frees the input's value.
TEST_F(Snapshots, AKeptValueOutlivesTheNextChange) {
    ComponentDefinition ticker = definition("Ticker", "W");
    ticker.remaps = {{"out", "/w"}};
    load(ticker);
    ComponentDefinition relay = definition("Relay", "P");
    relay.remaps = {{"in", "/w"}};
    load(relay);
    step(4);
    const double kept = value("/P", "out");
    configure([](RunnerSettings& settings) { settings.whitelist = "/w"; });
    unload("/W");  // P now reads the topic, which has no messages,
    configure([](RunnerSettings& settings) { settings.whitelist = ""; });  // which is removed, too
    const Snapshot snapshot = take();
    replace("/P", relay);
    restore(snapshot);
    step(1);
    ASSERT_EQ(value("/P", "out"), kept);
    for (const char* name : {"X", "Y", "Z"}) {  // its memory is reused
        ComponentDefinition other = definition("Ticker", name);
        other.remaps = {{"out", std::string("/") + name}};
        load(other);
    }
    step(1);
    EXPECT_EQ(value("/P", "out"), kept);
}

// Fewer bytes on the wire do not mean less memory: here a dimension without reserved memory. The
// sanitizer detects an allocation in the cycle.
TEST_F(Snapshots, OfAnotherShapeAllocatesNothingInTheCycle) {
    load(chaos("P", "S_x", "R_checked"));  // no reader with a loop break, which would copy it
    Snapshot snapshot = take();
    const auto word = [](std::uint32_t number) {
        return std::string(reinterpret_cast<const char*>(&number), sizeof number);
    };
    const std::string other =
        word(1) + word(0) + word(0) + word(0) + word(0) + word(2) + std::string(16, '\0');
    snapshot.components[0].outputs[3].value.bytes = other;
    start();
    ASSERT_TRUE(runs());
    restore(snapshot);
    stop();
    restore(snapshot);
    EXPECT_EQ(take().components[0].outputs[3].value.bytes, other);
}

TEST_F(Snapshots, WithAnInvalidClockIsRejected) {
    loadRing();
    step(5);
    const Snapshot snapshot = take();
    for (const auto& change : std::vector<std::function<void(Snapshot&)>>{
             [](Snapshot& other) { other.clock.elapsed_ns = 0; },
             [](Snapshot& other) { other.clock.elapsed_ns = -1; },
             [](Snapshot& other) { other.clock.time_ns = INT64_MIN; },
             [](Snapshot& other) { other.clock.time_ns = INT64_MAX; },
             [](Snapshot& other) { other.clock.total_elapsed_ns = INT64_MIN; },
             // More seconds than ros::Time can hold: publishing the cycle would throw.
             [](Snapshot& other) { other.clock.stamp_ns = 5'000'000'000'000'000'000; }}) {
        Snapshot other = snapshot;
        change(other);
        expectRefused(other, "clock");
    }
}

// A rejected snapshot of a stopped runner runs no hooks.
TEST_F(Snapshots, RejectedOneStartsNothing) {
    load(definition("Recorder", "C"));
    Snapshot snapshot = take();
    for (auto& [name, value] : snapshot.components[0].parameters) {
        if (name == "gain") value = 50.0;  // above its maximum
    }
    const std::uint32_t before = runner().numberedState().number;
    EXPECT_NE(errorOf([&] { restore(snapshot); }), "");
    EXPECT_EQ(runner().numberedState().number, before) << "it must not be started";
}

TEST_F(Snapshots, AlteredFileIsRejected) {
    loadRing();
    step(5);
    const std::string file = snapshotToFile(take());
    const auto told = [&](const std::string& bytes) {
        return errorOf([&] { snapshotFromFile(bytes); });
    };
    EXPECT_EQ(told(file), "");
    for (const std::string& none : {std::string(), std::string("RTCF"), std::string(100, 'x')})
        EXPECT_NE(told(none).find("the file is not a snapshot"), std::string::npos);
    std::string newer = file;
    newer[8] = 3;
    EXPECT_NE(told(newer).find("has format 3, this rtcf reads format 2"), std::string::npos);
    for (std::size_t at = 12; at < file.size(); at += 1 + at / 97) {
        std::string damaged = file;
        damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
        EXPECT_NE(told(damaged).find("is damaged"), std::string::npos) << at;
    }
    EXPECT_NE(told(file.substr(0, file.size() - 1)).find("is damaged"), std::string::npos);
    EXPECT_NE(told(file + "x").find("is damaged"), std::string::npos);
}

TEST_F(Snapshots, ListsComponentsWithoutState) {
    load(definition("Controller", "C"));
    const auto notes = onGraphThread([&] { return runner().takeSnapshot().notes; });
    ASSERT_EQ(notes.size(), 1U);
    EXPECT_NE(notes[0].find("components without declared state"), std::string::npos);
    EXPECT_NE(notes[0].find("/C"), std::string::npos);
}

}  // namespace
}  // namespace rtcf::test
