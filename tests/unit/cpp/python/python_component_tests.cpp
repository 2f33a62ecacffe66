// A component made from tables, whose hooks are functions in this file.
#include "python_component.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "rtcf/component.hpp"

namespace rtcf::test {

namespace {

using namespace rtcf::python;

struct Record {
    RecordHead head;
    double u;
    std::int64_t age;
    double x;
    double gain;
    std::int64_t count;
    bool is_new, is_valid, is_connected, is_written;
    RaisedValues raised;
};
constexpr Record kFresh{{}, 0.0, 0, 0.0, 2.5, 0, false, false, false, false, {}};

struct Raised {
    const char* bytes;
    std::int32_t size;
};
constexpr Raised kLimit{"limit", 5};

const void* start(void* memory) {
    Record& record = *static_cast<Record*>(memory);
    record.x = 9.0;
    record.is_written = true;
    return nullptr;
}

// At the offset used by machine code.
template <typename T>
T& placeIn(void* memory, std::size_t offset) {
    return *reinterpret_cast<T*>(static_cast<std::byte*>(memory) + offset);
}

// Writes u * gain if u is new, and raises if it is negative.
const void* update(void* memory, void* const* ports) {
    constexpr PortPlaces places = AbiProbe::portPlaces();
    Record& record = *static_cast<Record*>(memory);
    record.head.line = 12;
    ++record.count;
    const Slot<double>& read = *placeIn<Slot<double>*>(ports[0], places.source);
    const bool is_new =
        std::exchange(placeIn<std::int64_t>(ports[0], places.seen), read.stamp) != read.stamp;
    record.u = read.value;
    record.is_written = true;
    record.raised = {7, 3};
    if (record.u < 0.0) return &kLimit;
    if (is_new) {
        Slot<double>& written = *placeIn<Slot<double>*>(ports[1], places.raw);
        written.value = record.u * record.gain;
        written.stamp = *placeIn<const Shared<std::int64_t>*>(ports[1], places.now);
    }
    record.is_written = false;
    return nullptr;
}

constexpr std::uint64_t hashOf(std::string_view text) { return detail::stateHash(text); }

const TypeTable kNumber{Scalar::Double, 0, 0};
const TypeTable kInteger{Scalar::Int64, 0, 0};
const InputTable kInput{"u",
                        "rad",
                        "wanted angle",
                        &kNumber,
                        nullptr,
                        nullptr,
                        offsetof(Record, u),
                        offsetof(Record, is_new),
                        offsetof(Record, age),
                        offsetof(Record, is_connected),
                        nullptr,
                        0,
                        {LogLevel::Warn, "gain.py", 3, "update", "too large"}};
const OutputTable kOutput{
    "x",     "m", "position", &kNumber, nullptr, 0, offsetof(Record, is_written),
    nullptr, 0,   nullptr,    0};
const ParameterTable kGain{"gain",  "", "", Scalar::Double, offsetof(Record, gain), 1, 0, 0.0, 0.0,
                           nullptr, 0,  0};
const StateTable kCount{"count", "", "", &kInteger, offsetof(Record, count), 0};
const RaiseTable kRaise{hashOf("limit"), 0, "IndexError: index {} beyond size {}", 1};
const LineTable kLine{12, "self.x.write(y)"};
const ComponentTable kTable{"Gain",  "doc",    "gain.py", nullptr, &kFresh, sizeof(Record),
                            nullptr, &start,   &update,   nullptr, 0,       &kInput,
                            1,       &kOutput, 1,         &kGain,  1,       nullptr,
                            0,       &kCount,  1,         &kRaise, 1,       &kLine,
                            1};

}  // namespace

class PythonComponents : public testing::Test {
   protected:
    PythonComponents() {
        source_->value = 3.0;
        accessTo(component_).inputs().front()->connect(source_.get(), false);
    }
    // A new value, in the next cycle.
    void arrive() {
        accessTo(component_).setTime(component_.time() + 1);
        source_->stamp = component_.time();
    }
    const Slot<double>& written() const {
        return *static_cast<const Slot<double>*>(
            accessTo(component_).outputs().front()->slot().get());
    }

    std::shared_ptr<Slot<double>> source_ = std::make_shared<Slot<double>>();
    PythonComponent component_{kTable};
};

TEST_F(PythonComponents, DeclaresTheContentOfItsTable) {
    EXPECT_EQ(accessTo(component_).inputs().front()->name(), "u");
    EXPECT_EQ(accessTo(component_).inputs().front()->texts().unit, "rad");
    EXPECT_EQ(accessTo(component_).inputs().front()->texts().doc, "wanted angle");
    EXPECT_EQ(accessTo(component_).outputs().front()->unit(), "m");
    EXPECT_EQ(accessTo(component_).outputs().front()->texts().doc, "position");
    const ParameterDeclaration& gain = accessTo(component_).parameters().front()->declaration();
    EXPECT_EQ(gain.type, "double");
    EXPECT_EQ(std::get<double>(gain.default_value), 2.5);
    EXPECT_EQ(gain.minimum, 0.0);
    EXPECT_FALSE(gain.maximum);
    EXPECT_EQ(accessTo(component_).states().front().type, "int64");
}

TEST_F(PythonComponents, WritesOnlyInACycle) {
    ASSERT_TRUE(component_.start());
    component_.update();
    EXPECT_EQ(written().stamp, 0);
    arrive();
    component_.update();
    const std::int64_t time = component_.time();
    EXPECT_EQ(written().stamp, time);
    EXPECT_EQ(written().value, 7.5);
    accessTo(component_).setTime(time + 1);
    component_.update();
    EXPECT_EQ(written().stamp, time);
}

TEST_F(PythonComponents, AParameterTakesEffectAtItsCommit) {
    ParameterBase& gain = *accessTo(component_).parameters().front();
    arrive();
    gain.stage(10.0);
    component_.update();
    EXPECT_EQ(written().value, 7.5);
    gain.commit();
    gain.release();
    arrive();
    component_.update();
    EXPECT_EQ(written().value, 30.0);
    EXPECT_FALSE(gain.staged());
}

TEST(PythonParameters, AnEnumIsSetByName) {
    static constexpr std::array<ChoiceTable, 3> kChoices{{{"IDLE", 0}, {"RUN", -4}, {"GO", -4}}};
    const ParameterTable parameter{"mode", "",  "",  Scalar::Int64,   offsetof(Record, count), 0,
                                   0,      0.0, 0.0, kChoices.data(), kChoices.size(),         0};
    Record fresh = kFresh;
    fresh.count = -4;
    ComponentTable table = kTable;
    table.record = &fresh;
    table.parameters = &parameter;
    PythonComponent component(table);
    ParameterBase& mode = *accessTo(component).parameters().front();
    EXPECT_EQ(mode.declaration().type, "enum");
    EXPECT_EQ(std::get<std::string>(mode.declaration().default_value), "RUN");
    EXPECT_EQ(mode.declaration().choices.size(), 3U);
    ParameterValue unknown = std::string("FLY");
    EXPECT_EQ(mode.check(unknown), "parameter mode = FLY is none of IDLE, RUN, GO");
    const auto* count =
        static_cast<const std::int64_t*>(accessTo(component).states().front().value);
    EXPECT_EQ(*count, -4);
    mode.stage(std::string("IDLE"));
    mode.commit();
    EXPECT_EQ(*count, 0);
    mode.stage(std::string("GO"));
    mode.commit();
    EXPECT_EQ(*count, -4);
}

TEST_F(PythonComponents, AnExceptionWritesNothingAndHasItsPlace) {
    source_->value = -1.0;
    arrive();
    std::string said;
    try {
        component_.update();
    } catch (const std::runtime_error& error) {
        said = error.what();
    }
    EXPECT_EQ(said, "gain.py:12: `self.x.write(y)`: IndexError: index 7 beyond size 3");
    EXPECT_EQ(written().stamp, 0);
    source_->value = 1.0;
    component_.update();
    EXPECT_EQ(written().stamp, 0);
}

TEST_F(PythonComponents, StateIsInItsRecord) {
    component_.update();
    component_.update();
    const StateDeclaration& count = accessTo(component_).states().front();
    EXPECT_EQ(*static_cast<const std::int64_t*>(count.value), 2);
    EXPECT_EQ(count.print(count.value), "2");
    EXPECT_EQ(count.print(count.initial.data()), "0");
}

}  // namespace rtcf::test
