// The values that inputs read, compared with a model, over random changes: writers are added,
// removed and replaced; loop breaks, topics, components that skip cycles, ends of the loop (which
// restart its time) and snapshots.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <random>
#include <string>

#include "snapshot/snapshot.hpp"
#include "support/runner_fixture.hpp"

namespace rtcf::test {
namespace {

constexpr int kReadingChanges = 300;

// A value, by the number of its write; 0 = never written.
struct Written {
    double value = 0.0;
    int number = 0;
};

struct ModelReader {
    std::uint32_t every = 1;
    bool broken = false;
    bool early = false;  // runs before the writer
    // The value of an earlier writer or of a topic; unset = the present writer's.
    std::optional<Written> held = Written{};
    int read = 0;  // number of the value that was read last
    std::optional<double> out;
    DataStatus status = DataStatus::None;
};

struct Model {
    std::uint64_t iteration = 0;
    std::optional<std::int64_t> writer;  // its period, cycles
    Written slot;                        // the writer's value,
    Written latched;                     // and at the begin of the cycle
    int writes = 0;
    std::map<std::string, ModelReader> readers;

    // The values of the new writer count from its first write on.
    static void connect(ModelReader& reader, const Written& source) {
        if (!reader.held || (reader.held->number != 0 && source.number == 0)) return;
        reader.held.reset();
        reader.read = 0;
    }
    void read(ModelReader& reader) {
        if (iteration % reader.every != 0) return;
        const Written& source = reader.broken && !reader.early ? latched : slot;
        if (writer) connect(reader, source);
        const Written& found = reader.held ? *reader.held : source;
        reader.status = found.number != 0 ? DataStatus::Old : DataStatus::None;
        if (found.number != reader.read) reader.status = DataStatus::New;
        reader.read = found.number;
        reader.out = found.value + 1.0;
    }
    void receive(double message) {
        ++writes;
        for (auto& [name, reader] : readers) {
            reader.held = Written{message, writes};
            reader.read = 0;
        }
    }
    void cycle() {
        latched = slot;
        for (auto& [name, reader] : readers)
            if (reader.early) read(reader);
        if (writer && iteration % static_cast<std::uint64_t>(*writer) == 0)
            slot = {static_cast<double>(iteration), ++writes};
        for (auto& [name, reader] : readers)
            if (!reader.early) read(reader);
        ++iteration;
    }
    // The present writer, if any, leaves.
    void setWriter(std::optional<std::int64_t> period) {
        for (auto& [name, reader] : readers) {
            if (writer) connect(reader, slot);
            if (!reader.held) reader.held = slot;
        }
        writer = period;
        slot = latched = {};
    }
};

class Reading : public RunnerFixture, public ::testing::WithParamInterface<unsigned> {
   protected:
    int chance(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }

    void loadReaders() {
        for (const auto& [name, early] : {std::pair("A", true), {"P", false}, {"Z", false}}) {
            ModelReader& reader = model_.readers[name];
            reader.early = early;
            reader.broken = early;
            reader.every = 1U << static_cast<unsigned>(chance(3));
            ComponentDefinition relay = definition("Relay", name);
            relay.remaps = {{"in", "/m"},
                            {"out", std::string("/out_of_") + name},
                            {"status", std::string("/status_of_") + name}};
            relay.every = reader.every;
            relay.phase = 0;
            if (early) relay.breaks.ports = {"in"};
            load(relay);
        }
    }

    ComponentDefinition writer(std::int64_t period) {
        ComponentDefinition ticker = definition("Ticker", "M");
        ticker.remaps = {{"out", "/m"}};
        ticker.parameters = {{"every", period}};
        return ticker;
    }

    bool hasTopic() const { return mapped_ && !model_.writer; }

    void setWriter(std::optional<std::int64_t> period) {
        if (!period) {
            unload("/M");
        } else if (model_.writer) {
            replace("/M", writer(*period));
        } else {
            load(writer(*period));
        }
        model_.setWriter(period);
        message_.reset();
    }

    void takeMessage() {
        if (message_ && hasTopic()) model_.receive(*message_);
        message_.reset();
    }

    void cycle() {
        step(1);
        takeMessage();
        model_.cycle();
        for (const auto& [name, reader] : model_.readers) {
            const std::string component = "/" + name;
            if (!reader.out) {
                ASSERT_TRUE(std::isnan(value(component, "out"))) << name;
                continue;
            }
            ASSERT_EQ(value(component, "out"), *reader.out) << name;
            ASSERT_EQ(value(component, "status"), static_cast<double>(reader.status)) << name;
        }
    }

    void end() {
        stop();
        takeMessage();
        model_.latched = model_.slot;
        model_.iteration = 0;
    }

    void changeSomething() {
        const std::int64_t period = 1 + chance(4);
        switch (chance(8)) {
            case 0:
                if (model_.writer) setWriter(std::nullopt);
                break;
            case 1:
            case 2:
                setWriter(period);
                break;
            case 3: {
                const std::string name = chance(2) == 0 ? "P" : "Z";
                bool& broken = model_.readers[name].broken;
                broken = !broken;
                setBreak("/" + name, "in", broken);
                break;
            }
            case 4:
                if (state() == RunnerState::Stepping) end();
                break;
            case 5:
                mapped_ = !mapped_;
                configure(
                    [this](RunnerSettings& settings) { settings.whitelist = mapped_ ? "/m" : ""; });
                message_.reset();
                break;
            case 6:
                if (!hasTopic()) break;
                message_ = 1000.0 + chance(1000);
                send(*message_);
                break;
            default:
                goBack();
        }
    }

    // Takes a snapshot, runs more cycles, and restores it.
    void goBack() {
        if (state() != RunnerState::Stepping) return;
        const Model before = model_;
        const auto snapshot = onGraphThread([&] { return runner().takeSnapshot().snapshot; });
        for (int i = chance(6); i > 0; --i) cycle();
        if (chance(2) == 0) end();
        for (int i = chance(3); i > 0; --i) cycle();
        onGraphThread([&] { return runner().restore(snapshot, [](const std::string&) {}); });
        model_ = before;
    }

    void send(double number) {
        std::uint8_t bytes[sizeof number];
        std::memcpy(bytes, &number, sizeof number);
        ASSERT_TRUE(bridge().injector("/m")->deliver(bytes, sizeof bytes));
    }

    std::mt19937 random_{GetParam()};
    Model model_;
    bool mapped_ = false;  // /m is a topic
    std::optional<double> message_;
};

TEST_P(Reading, IsThatOfTheModel) {
    loadReaders();
    for (int i = 0; i < kReadingChanges; ++i) {
        SCOPED_TRACE("change " + std::to_string(i));
        changeSomething();
        ASSERT_FALSE(HasFatalFailure());
        for (int cycles = chance(4); cycles > 0; --cycles) {
            cycle();
            ASSERT_FALSE(HasFatalFailure());
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Seeds, Reading, ::testing::Range(1U, 6U));

}  // namespace
}  // namespace rtcf::test
