// Stamps: which values are new to an input, and how old they are. First random sequences of changes
// against a model that knows values by number, not by stamp; then single rules.
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "realtime/cycle_counter.hpp"
#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

constexpr int kStampChanges = 250;

class Stamps : public RunnerFixture {
   protected:
    static ComponentDefinition sayer(const std::string& type,
                                     std::vector<std::pair<std::string, ParameterValue>> values) {
        ComponentDefinition result = definition(type, "M");
        result.remaps = {{"out", "/m"}};
        result.parameters = std::move(values);
        return result;
    }
    static ComponentDefinition listener(const std::string& name, bool broken = false) {
        ComponentDefinition result = definition("Listener", name);
        result.remaps = {{"in", "/m"}};
        for (const char* port : {"value", "status", "news", "wired", "written"})
            result.remaps.emplace_back(port, "/" + name + "/" + port);
        if (broken) result.breaks.ports = {"in"};
        return result;
    }
    void map(bool mapped) {
        configure([&](RunnerSettings& settings) { settings.whitelist = mapped ? "/m" : ""; });
    }
    /// Sends a message to the topic /m.
    /// @param age_ns time since its arrival
    void send(double number, std::int64_t age_ns = 0) {
        std::array<std::uint8_t, sizeof number> bytes{};
        std::memcpy(bytes.data(), &number, sizeof number);
        ASSERT_TRUE(bridge().injector("/m")->deliver(bytes.data(), sizeof number,
                                                     executor::monotonicNow() - age_ns));
    }
    /// Time at which the value that a listener reads was written, ns.
    std::int64_t written(const std::string& name) {
        return static_cast<std::int64_t>(value("/" + name, "written"));
    }
};

// The model: a value has a number, and a reader knows the number that it read last.
struct Said {
    double value = 0.0;
    int number = 0;  // 0 = none
};

struct Hearer {
    bool broken = false;
    bool early = false;  // runs before the writer
    bool live = false;   // reads the writer's value; otherwise `kept`
    bool fed = false;    // `kept` came from the present topic
    Said kept;
    int read = 0;
    DataStatus status = DataStatus::None;
    double value = 0.0;
    int news = 0;

    void connect(const Said& said) {
        if (live || (kept.number != 0 && said.number == 0)) return;
        live = true;
        read = 0;
    }
    void hear(const Said* said) {
        if (said != nullptr) connect(*said);
        const Said& found = live && said != nullptr ? *said : kept;
        status = found.number == 0 ? DataStatus::None : DataStatus::Old;
        if (found.number != read) status = DataStatus::New;
        if (status == DataStatus::New) ++news;
        read = found.number;
        value = found.value;
    }
};

struct Voice {
    double number = 0.0;
    bool starts = false;
    bool takes_over = false;
    int every = 0;
    int in_place = 0;
    bool quiet() const { return every == 0 && in_place == 0; }
};

class StampsModel : public Stamps, public ::testing::WithParamInterface<unsigned> {
   protected:
    int chance(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }
    bool topic() const { return mapped_ && !voice_; }
    bool active() const { return running_ || stepping_; }

    void say(double value) { said_ = {value, ++numbers_}; }

    // A loop break reads the value of the previous cycle.
    const Said* heard(const Hearer& hearer, const Said* before) const {
        return hearer.broken ? before : &said_;
    }

    void modelCycle() {
        const Said before = said_;
        for (auto& [name, hearer] : hearers_)
            if (hearer.early) hearer.hear(voice_ ? &before : nullptr);
        if (voice_) {
            if (voice_->every != 0 && iteration_ % voice_->every == 0)
                say(voice_->number + iteration_);
            // Changes in place without publish() are seen by nobody.
        }
        for (auto& [name, hearer] : hearers_)
            if (!hearer.early) hearer.hear(voice_ ? heard(hearer, &before) : nullptr);
        ++iteration_;
    }

    void takeMessage() {
        if (!message_) return;
        const Said message{*message_, ++numbers_};
        for (auto& [name, hearer] : hearers_) {
            hearer.kept = message;
            hearer.live = false;
            hearer.fed = true;
            hearer.read = 0;
        }
        message_.reset();
    }

    void setVoice(std::optional<Voice> next) {
        message_.reset();
        const bool replaces = next && voice_;
        for (auto& [name, hearer] : hearers_) {
            if (voice_) hearer.connect(said_);
            if (hearer.live) hearer.kept = said_;
            hearer.live = hearer.fed = false;
        }
        voice_ = next;
        sent_ = false;
        said_ = {};
        if (!voice_) return;
        if (active() && voice_->starts) say(voice_->number + 0.25);
        if (replaces && voice_->takes_over) say(voice_->number + 0.5);
        for (auto& [name, hearer] : hearers_) hearer.connect(said_);
    }

    void changeVoice() {
        std::optional<Voice> next;
        if (!voice_ || chance(3) != 0) {
            next = Voice{100.0 * ++voices_, chance(2) == 0, active() && chance(2) == 0};
            if (!running_) next->every = chance(3);
            if (!running_) next->in_place = chance(3);
        }
        if (!next) {
            unload("/M");
        } else {
            const auto count = [](int value) { return ParameterValue(std::int64_t{value}); };
            const ComponentDefinition writer = sayer(chance(2) == 0 ? "PlainSayer" : "CheckedSayer",
                                                     {{"number", next->number},
                                                      {"starts", next->starts},
                                                      {"takes_over", next->takes_over},
                                                      {"every", count(next->every)},
                                                      {"in_place", count(next->in_place)}});
            ComponentDefinition optional = writer;
            optional.optional = chance(3) == 0;
            if (voice_) {
                replace("/M", optional);
            } else {
                load(optional);
            }
        }
        setVoice(next);
    }

    void beginLoop() {
        iteration_ = 0;
        if (voice_ && voice_->starts) say(voice_->number + 0.25);
    }

    void endLoop() {
        if (!active()) return;
        stop();
        takeMessage();  // in the last cycle
        running_ = stepping_ = false;
    }

    void compare() {
        for (const auto& [name, hearer] : hearers_) {
            const std::string component = "/" + name;
            ASSERT_EQ(value(component, "news"), hearer.news) << name;
            ASSERT_EQ(value(component, "status"), static_cast<double>(hearer.status)) << name;
            if (hearer.status != DataStatus::None) {
                ASSERT_EQ(value(component, "value"), hearer.value) << name;
            }
            ASSERT_EQ(value(component, "wired"), voice_ || sent_ ? 1.0 : 0.0) << name;
        }
    }

    // Cycles after a change: single steps, or so many of a running loop that nothing changes any
    // more.
    void runCycles() {
        if (running_) {
            takeMessage();
            for (int i = 0; i < 3; ++i) modelCycle();
            ASSERT_TRUE(runs(5));
            compare();
            return;
        }
        for (int i = chance(4); i > 0; --i) {
            if (!stepping_) beginLoop();
            stepping_ = true;
            takeMessage();
            modelCycle();
            step(1);
            compare();
            if (HasFatalFailure()) return;
        }
    }

    void startLoop() {
        if (active() || (voice_ && !voice_->quiet())) return;
        takeMessage();
        for (auto& [name, hearer] : hearers_)
            if (hearer.fed) hearer.read = hearer.kept.number;
        beginLoop();
        start();
        running_ = true;
    }

    void changeSomething() {
        switch (chance(8)) {
            case 0:
            case 1:
            case 2:
                changeVoice();
                break;
            case 3: {
                bool& broken = hearers_["Z"].broken;
                broken = !broken;
                setBreak("/Z", "in", broken);
                break;
            }
            case 4:
                mapped_ = !mapped_;
                map(mapped_);
                sent_ = false;
                message_.reset();
                for (auto& [name, hearer] : hearers_) hearer.fed = false;
                break;
            case 5:
                if (!topic()) break;
                message_ = 1'000'000.0 + chance(1000);
                send(*message_);
                sent_ = true;
                break;
            case 6:
                startLoop();
                break;
            default:
                endLoop();
        }
    }

    std::mt19937 random_{GetParam()};
    std::map<std::string, Hearer> hearers_;
    std::optional<Voice> voice_;
    Said said_;  // the writer's value
    int numbers_ = 0;
    int voices_ = 0;
    int iteration_ = 0;
    bool mapped_ = false;  // /m is a topic
    bool sent_ = false;    // somebody has written the present topic
    bool running_ = false;
    bool stepping_ = false;
    std::optional<double> message_;  // that no cycle has taken
};

TEST_P(StampsModel, EachReaderReadsWhatTheModelReads) {
    hearers_["A"].early = hearers_["A"].broken = true;
    load(listener("A", true));
    changeVoice();  // so that it runs before a broken Z
    for (const char* name : {"P", "Z"}) {
        load(listener(name));
        hearers_[name].connect(said_);
    }
    for (int i = 0; i < kStampChanges; ++i) {
        SCOPED_TRACE("change " + std::to_string(i));
        changeSomething();
        ASSERT_FALSE(HasFatalFailure());
        runCycles();
        ASSERT_FALSE(HasFatalFailure());
    }
}

INSTANTIATE_TEST_SUITE_P(Seeds, StampsModel, ::testing::Range(1U, 9U));

TEST_F(Stamps, MessageBeforeTheStartIsOldAndOfItsTrueAge) {
    map(true);
    load(listener("L"));
    const std::int64_t arrived = executor::monotonicNow() - 3'000'000'000;
    send(3.0, 3'000'000'000);
    start();
    ASSERT_TRUE(runs());
    EXPECT_EQ(value("/L", "value"), 3.0) << "it can be read";
    EXPECT_EQ(value("/L", "news"), 0.0);
    EXPECT_NEAR(static_cast<double>(written("L") - arrived), 0.0, 1e6);
    send(4.0);
    ASSERT_TRUE(runs());
    EXPECT_EQ(value("/L", "news"), 1.0);
    EXPECT_EQ(value("/L", "value"), 4.0);
    stop();
    start();
    ASSERT_TRUE(runs());
    EXPECT_EQ(value("/L", "news"), 1.0) << "also at the next start";
}

TEST_F(Stamps, MessageThatWasShownBeforeTheStartIsOld) {
    map(true);
    load(listener("L"));
    send(3.0, 3'000'000'000);
    EXPECT_EQ(value("/L", "in"), 3.0);
    start();
    ASSERT_TRUE(runs());
    EXPECT_EQ(value("/L", "news"), 0.0);
    EXPECT_LT(written("L"), executor::monotonicNow() - 2'900'000'000);
}

TEST_F(Stamps, MessageBetweenStepsIsNewInTheNextOne) {
    map(true);
    load(listener("L"));
    send(3.0, 3'000'000'000);
    step(1);
    EXPECT_EQ(value("/L", "status"), static_cast<double>(DataStatus::New));
    EXPECT_EQ(written("L"), 1'000'000) << "steps have no time between them";
}

TEST_F(Stamps, MessageIsOldToAReaderThatIsConnectedLater) {
    map(true);
    load(listener("L"));
    start();
    send(3.0);
    ASSERT_TRUE(eventually([&] { return value("/L", "news") == 1.0; }));
    load(listener("K"));
    replace("/L", listener("L"));
    ASSERT_TRUE(runs());
    for (const char* name : {"/K", "/L"}) {
        EXPECT_EQ(value(name, "value"), 3.0) << name;
        EXPECT_EQ(value(name, "status"), static_cast<double>(DataStatus::Old)) << name;
    }
    EXPECT_EQ(value("/K", "news"), 0.0);
    EXPECT_EQ(value("/L", "news"), 1.0) << "the successor has the state, and no news";
}

TEST_F(Stamps, QueueDropsMessagesOfTheTimeBeforeTheStartAndCountsThem) {
    map(true);
    ComponentDefinition collector = definition("Collector", "C");
    collector.remaps = {{"in", "/m"}};
    load(collector);
    for (int number = 1; number <= 6; ++number) send(number);
    start();
    send(7.0);
    ASSERT_TRUE(eventually([&] { return value("/C", "order") == 7.0; }));
    EXPECT_EQ(value("/C", "dropped"), 6.0);
    setParameters("/C", {{"takes", false}});
    send(8.0);
    ASSERT_TRUE(eventually([&] { return value("/C", "waiting") == 1.0; }));
    stop();
    setParameters("/C", {{"takes", true}});
    start();
    ASSERT_TRUE(runs());
    EXPECT_EQ(value("/C", "order"), 7.0) << "a message that waited at the stop is old, too";
    EXPECT_EQ(value("/C", "dropped"), 7.0);
    int lines = 0;
    for (const LogEntry& entry : logged()) {
        if (entry.message == "6 messages on /m from before the start were dropped") ++lines;
        if (entry.message == "1 message on /m from before the start was dropped") ++lines;
    }
    std::string all;
    for (const LogEntry& entry : logged()) all += entry.message + "\n";
    EXPECT_EQ(lines, 2) << all;
}

TEST_F(Stamps, QueueForgetsTheMessagesOfComponentsFromBeforeTheStart) {
    load(sayer("PlainSayer", {{"number", 1.0}, {"every", std::int64_t{1'000'000}}}));
    ComponentDefinition collector = definition("Collector", "C");
    collector.remaps = {{"in", "/m"}};
    load(collector);
    setParameters("/C", {{"takes", false}});
    start();
    ASSERT_TRUE(eventually([&] { return value("/C", "waiting") == 1.0; }));
    stop();
    setParameters("/C", {{"takes", true}});
    setParameters("/M", {{"number", 2.0}});
    start();
    ASSERT_TRUE(eventually([&] { return value("/C", "order") == 2.0; }));
    EXPECT_EQ(value("/C", "dropped"), 1.0);
}

TEST_F(Stamps, ChangesInPlaceThatWereNotPublishedAreNotPartOfASnapshot) {
    ComponentDefinition counting = definition("Counting", "M");
    counting.remaps = {{"out", "/m"}, {"vector", "/v"}};
    load(counting);
    load(listener("L"));
    ComponentDefinition reader = definition("VectorListener", "V");
    reader.remaps = {{"in", "/v"}};
    load(reader);
    step(50);
    EXPECT_EQ(value("/L", "status"), static_cast<double>(DataStatus::None));
    EXPECT_EQ(value("/V", "value"), 0.0) << "also a type whose copy is not noexcept";
    step(100);
    const auto snapshot = onGraphThread([&] { return runner().takeSnapshot().snapshot; });
    step(30);
    onGraphThread([&] { return runner().restore(snapshot, [](const std::string&) {}); });
    EXPECT_EQ(value("/L", "in"), 100.0);
    step(50);
    EXPECT_EQ(value("/L", "value"), 150.0);
    EXPECT_EQ(value("/V", "value"), 150.0);
}

TEST_F(Stamps, QueueGetsWhatASuccessorWritesInStart) {
    load(sayer("PlainSayer", {{"number", 1.75}, {"starts", true}}));
    ComponentDefinition collector = definition("Collector", "C");
    collector.remaps = {{"in", "/m"}};
    load(collector);
    step(2);
    EXPECT_EQ(value("/C", "order"), 2.0);
    replace("/M", sayer("PlainSayer", {{"number", 2.75}, {"starts", true}}));
    step(2);
    EXPECT_EQ(value("/C", "order"), 23.0);
    replace("/C", collector);
    step(2);
    EXPECT_EQ(value("/C", "order"), 23.0) << "a reloaded queue gets no old message";
}

TEST_F(Stamps, ValueOfStartBelongsToTheStart) {
    load(sayer("PlainSayer", {{"starts", true}}));
    load(listener("L"));
    for (int round = 0; round < 2; ++round) {
        const std::int64_t before = executor::monotonicNow();
        start();
        ASSERT_TRUE(runs());
        EXPECT_GE(written("L"), before);
        EXPECT_EQ(value("/L", "news"), round + 1.0);
        EXPECT_EQ(value("/M", "begun"), 0.0) << "the iteration is that of the new loop";
        stop();
    }
}

TEST_F(Stamps, SuccessorsValueReplacesOneFromOutside) {
    map(true);
    load(listener("A", true));
    load(listener("P"));
    start();
    send(3.0);
    ASSERT_TRUE(eventually([&] { return value("/P", "news") == 1.0; }));
    load(sayer("PlainSayer", {{"number", 5.0}, {"starts", true}}));
    ASSERT_TRUE(runs());
    for (const char* name : {"/A", "/P"}) {
        EXPECT_EQ(value(name, "value"), 5.25) << name;
        EXPECT_EQ(value(name, "news"), 2.0) << name;
    }
}

// All kinds of readers of an output that is changed in place, and published in the first cycle.
TEST_F(Stamps, ChangeInPlaceIsSeenByNoReaderBeforeItIsPublished) {
    for (const char* type : {"PlainSayer", "CheckedSayer"}) {
        for (const bool optional : {false, true}) {
            SCOPED_TRACE(std::string(type) + (optional ? ", optional" : ""));
            ComponentDefinition writer =
                sayer(type, {{"every", std::int64_t{1000}}, {"in_place", std::int64_t{1}}});
            writer.optional = optional;
            load(listener("A", true));
            load(writer);
            load(listener("P"));
            load(listener("Z", true));
            step(5);
            for (const char* name : {"/A", "/P", "/Z"}) {
                EXPECT_EQ(value(name, "value"), 0.0) << name;
                EXPECT_EQ(value(name, "news"), 1.0) << name;
                EXPECT_EQ(value(name, "status"), static_cast<double>(DataStatus::Old)) << name;
            }
            EXPECT_EQ(value("/M", "out"), 0.0);
            stop();
            for (const char* name : {"/A", "/M", "/P", "/Z"}) unload(name);
        }
    }
}

TEST_F(Stamps, SnapshotDoesNotReplaceTheMessagesOfARunningLoop) {
    map(true);
    load(listener("L"));
    start();
    send(3.0);
    ASSERT_TRUE(eventually([&] { return value("/L", "news") == 1.0; }));
    const auto snapshot = onGraphThread([&] { return runner().takeSnapshot().snapshot; });
    const std::int64_t before = executor::monotonicNow();
    send(4.0);
    ASSERT_TRUE(eventually([&] { return value("/L", "news") == 2.0; }));
    onGraphThread([&] { return runner().restore(snapshot, [](const std::string&) {}); });
    ASSERT_TRUE(runs());
    EXPECT_EQ(value("/L", "value"), 4.0);
    EXPECT_EQ(value("/L", "news"), 1.0) << "the state of the snapshot";
    EXPECT_GT(written("L"), before);
}

}  // namespace
}  // namespace rtcf::test
