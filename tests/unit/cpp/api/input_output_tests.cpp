// Inputs and outputs wired by hand, as by the loop at a cycle boundary.
#include <gtest/gtest.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>

#include <new>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "support/bare_component.hpp"

namespace rtcf::test {

// A copy may fail between its halves.
struct Halves {
    Halves() = default;
    Halves(const Halves& other) { *this = other; }
    Halves(Halves&&) = default;
    Halves& operator=(const Halves& other) {
        first = other.first;
        if (copies_throw) throw std::bad_alloc();
        second = other.second;
        return *this;
    }
    Halves& operator=(Halves&&) = default;
    ~Halves() = default;
    std::vector<double> first;
    std::vector<double> second;
    static inline bool copies_throw = false;
};
struct HalvesOnRos {
    static const char* name() { return "Halves"; }
    static void toMessage(const Halves& value, std_msgs::Float64MultiArray& message) {
        message.data = value.first;
    }
    static void fromMessage(const std_msgs::Float64MultiArray& message, Halves& value) {
        value.first = value.second = message.data;
    }
};

}  // namespace rtcf::test

template <>
struct rtcf::PortType<rtcf::test::Halves>
    : rtcf::MappedPortType<rtcf::test::Halves, std_msgs::Float64MultiArray,
                           rtcf::test::HalvesOnRos> {};

namespace rtcf::test {
namespace {

// True if a component's member, or the component, has a public function of that name.
#define HAS(NAME)                          \
    template <typename T, typename = void> \
    constexpr bool has_##NAME = false;     \
    template <typename T>                  \
    constexpr bool has_##NAME<T, std::void_t<decltype(&T::NAME)>> = true
HAS(attach);
HAS(close);
HAS(commit);
HAS(connect);
HAS(context);
HAS(fullName);
HAS(inputs);
HAS(receive);
HAS(release);
HAS(setConnected);
HAS(setTime);
HAS(slot);
HAS(stage);
#undef HAS
// For templates and overloaded functions.
template <typename T, typename = void>
constexpr bool declares = false;
template <typename T>
constexpr bool
    declares<T, std::void_t<decltype(std::declval<T&>().declare(std::declval<OutputPort*>()))>> =
        true;
template <typename T, typename = void>
constexpr bool stages_outputs = false;
template <typename T>
constexpr bool stages_outputs<T, std::void_t<decltype(std::declval<T&>().stageOutputs(
                                     std::declval<bool (*)(const OutputPort&)>()))>> = true;

static_assert(has_fullName<Component>);
static_assert(!has_attach<Component> && !has_context<Component> && !has_inputs<Component> &&
              !has_setTime<Component> && !declares<Component> && !stages_outputs<Component>);
using Access = ComponentAccess<Component>;
static_assert(has_setTime<Access> && declares<Access> && stages_outputs<Access>);
static_assert(!has_connect<Input<double>> && !has_slot<Input<double>>);
static_assert(!has_commit<Output<double>> && !has_setConnected<Output<double>> &&
              !has_slot<Output<double>> && !has_stage<Output<double>>);
static_assert(!has_commit<Parameter<double>> && !has_stage<Parameter<double>>);
static_assert(has_stage<Derived<double>> && !has_commit<Derived<double>> &&
              !has_release<Derived<double>>);
static_assert(!has_receive<Queue<double, 2>> && !has_close<Mailbox<double, double>>);

class InputOutput : public ::testing::Test {
   protected:
    InputPort& port() { return *accessTo(component).inputs().front(); }
    void connect(const OutputBase& output) {
        port().connect(portOf(component, output).slot().get(), false);
    }
    void writeAt(Output<double>& output, double value, std::int64_t time_ns) {
        accessTo(component).setTime(time_ns);
        output.write(value);
    }
    // In the next cycle.
    void write(Output<double>& output, double value) {
        writeAt(output, value, component.time() + 1);
    }
    // As the loop does before the component's turn.
    DataStatus read() {
        port().connectWritten();
        return in.read();
    }

    BareComponent component;
    Input<double> in{&component, "in"};
    Output<double> first{&component, "first"};
    Output<double> second{&component, "second"};
    Shared<bool> fed = true;  // somebody writes the input from outside
};

TEST_F(InputOutput, UnconnectedInputHasNoData) {
    EXPECT_FALSE(in.connected(&component));
    EXPECT_EQ(in.read(), DataStatus::None);
    EXPECT_FALSE(in.hasValue());
    EXPECT_EQ(in.value(), 0.0);
    EXPECT_EQ(in.age(&component), -1);
}

TEST_F(InputOutput, ValueIsNewOnceAndThenOld) {
    connect(first);
    EXPECT_EQ(in.read(), DataStatus::None);
    write(first, 1.5);
    EXPECT_TRUE(in.isNew());
    EXPECT_EQ(in.read(), DataStatus::New);
    EXPECT_FALSE(in.isNew());
    EXPECT_EQ(in.value(), 1.5);
    EXPECT_EQ(in.read(), DataStatus::Old);
    write(first, 1.5);
    EXPECT_EQ(in.read(), DataStatus::New) << "a write is new even if the value is equal";
}

TEST_F(InputOutput, SeveralWritesInOneCycleAreOneForAReader) {
    connect(first);
    write(first, 1.0);
    first.write(2.0);
    EXPECT_EQ(in.read(), DataStatus::New);
    EXPECT_EQ(in.value(), 2.0);
    EXPECT_EQ(in.read(), DataStatus::Old);
}

TEST_F(InputOutput, ValueIsTheNewestOneEvenIfItWasNotRead) {
    connect(first);
    write(first, 1.0);
    in.read();
    write(first, 2.0);
    EXPECT_EQ(in.value(), 2.0);
    EXPECT_EQ(in.read(), DataStatus::New);
}

TEST_F(InputOutput, ValueWrittenBeforeTheFirstConnectionIsNew) {
    first.write(2.0);
    connect(first);
    EXPECT_EQ(in.read(), DataStatus::New);
    EXPECT_EQ(in.value(), 2.0);
}

TEST_F(InputOutput, ValueChangedInPlaceCountsWhenPublished) {
    connect(first);
    first.value() = 3.0;
    EXPECT_EQ(in.read(), DataStatus::None);
    first.publish();
    EXPECT_EQ(in.read(), DataStatus::New);
    EXPECT_EQ(in.value(), 3.0);
}

TEST_F(InputOutput, ReadIntoACopyHonoursCopyOld) {
    connect(first);
    double copy = -1.0;
    EXPECT_EQ(in.read(copy), DataStatus::None);
    EXPECT_EQ(copy, -1.0);
    first.write(4.0);
    EXPECT_EQ(in.read(copy), DataStatus::New);
    EXPECT_EQ(copy, 4.0);
    copy = -1.0;
    EXPECT_EQ(in.read(copy, false), DataStatus::Old);
    EXPECT_EQ(copy, -1.0);
    EXPECT_EQ(in.read(copy, true), DataStatus::Old);
    EXPECT_EQ(copy, 4.0);
}

TEST_F(InputOutput, RewiredInputReadsWhatTheNewWriterHasWritten) {
    connect(first);
    write(first, 1.0);
    in.read();
    write(second, 9.0);
    connect(second);
    EXPECT_FALSE(port().waiting());
    EXPECT_EQ(read(), DataStatus::New);
    EXPECT_EQ(in.value(), 9.0);
}

TEST_F(InputOutput, RewiredInputKeepsItsValueUntilTheNewWriterWrites) {
    connect(first);
    write(first, 1.0);
    in.read();
    connect(second);
    EXPECT_TRUE(port().waiting());
    EXPECT_EQ(read(), DataStatus::Old);
    EXPECT_EQ(in.value(), 1.0);
    write(second, 2.0);
    EXPECT_EQ(read(), DataStatus::New);
    EXPECT_EQ(in.value(), 2.0);
    EXPECT_FALSE(port().waiting());
}

// The new writer may write in the cycle whose value of the old one was read last.
TEST_F(InputOutput, FirstWriteOfANewWriterIsNewAtAnyTime) {
    connect(first);
    write(first, 1.0);
    EXPECT_EQ(in.read(), DataStatus::New);
    connect(second);
    second.write(2.0);
    EXPECT_EQ(read(), DataStatus::New);
    EXPECT_EQ(in.value(), 2.0);
}

TEST_F(InputOutput, UnreadValueOfAnEarlierWriterIsStillNew) {
    connect(first);
    write(first, 1.0);
    connect(second);
    EXPECT_EQ(read(), DataStatus::New);
    EXPECT_EQ(in.value(), 1.0);
    EXPECT_EQ(read(), DataStatus::Old);
}

TEST_F(InputOutput, InputRewiredTwiceKeepsTheNewestValueThatItHas) {
    Output<double> third{&component, "third"};
    connect(first);
    write(first, 1.0);
    in.read();
    connect(second);
    connect(third);
    EXPECT_EQ(read(), DataStatus::Old);
    EXPECT_EQ(in.value(), 1.0) << "the second writer has not written";
    connect(second);
    write(second, 2.0);
    connect(third);
    EXPECT_EQ(read(), DataStatus::New) << "written before the third was connected";
    EXPECT_EQ(in.value(), 2.0);
    write(second, 2.5);
    write(third, 3.0);
    EXPECT_EQ(read(), DataStatus::New);
    EXPECT_EQ(in.value(), 3.0);
}

TEST_F(InputOutput, ContinuedConnectionKeepsReadAndUnreadValues) {
    Output<double> copy{&component, "copy"};
    connect(first);
    write(first, 1.0);
    in.read();
    portOf(component, first)
        .type()
        .copy(*portOf(component, copy).slot(), *portOf(component, first).slot());
    port().connect(portOf(component, copy).slot().get(), true);
    EXPECT_EQ(read(), DataStatus::Old) << "the write was read before";
    EXPECT_EQ(in.value(), 1.0);
    write(first, 2.0);
    portOf(component, first)
        .type()
        .copy(*portOf(component, copy).slot(), *portOf(component, first).slot());
    port().connect(portOf(component, first).slot().get(), true);
    EXPECT_EQ(read(), DataStatus::New);
    EXPECT_EQ(in.value(), 2.0);
}

TEST_F(InputOutput, ContinuedConnectionKeepsAnEarlierWritersValueToo) {
    Output<double> copy{&component, "copy"};
    connect(first);
    write(first, 1.0);
    in.read();
    connect(second);
    portOf(component, first)
        .type()
        .copy(*portOf(component, copy).slot(), *portOf(component, second).slot());
    port().connect(portOf(component, copy).slot().get(), true);
    EXPECT_EQ(read(), DataStatus::Old);
    EXPECT_EQ(in.value(), 1.0) << "the new writer has not written yet";
    write(second, 9.5);
    portOf(component, first)
        .type()
        .copy(*portOf(component, copy).slot(), *portOf(component, second).slot());
    EXPECT_EQ(read(), DataStatus::New);
    EXPECT_EQ(in.value(), 9.5);
}

TEST_F(InputOutput, DisconnectedInputKeepsItsValueAsOldData) {
    connect(first);
    first.write(1.0);
    in.read();
    port().disconnect();
    EXPECT_FALSE(in.connected(&component));
    EXPECT_EQ(read(), DataStatus::Old);
    EXPECT_EQ(in.value(), 1.0);
}

TEST_F(InputOutput, InjectedValueIsNewAndMayMoveToAnotherSlot) {
    Output<double> front{&component, "front"};
    Output<double> next{&component, "next"};
    port().connectOutside(portOf(component, front).slot().get(), &fed);
    write(front, 1.0);
    port().inject(portOf(component, front).slot().get());
    EXPECT_EQ(in.read(), DataStatus::New);
    next.write(2.0);  // also with the stamp of the first one
    port().inject(portOf(component, next).slot().get());
    EXPECT_EQ(in.value(), 2.0) << "the first slot may be overwritten from here on";
    EXPECT_EQ(in.read(), DataStatus::New);
    EXPECT_EQ(in.read(), DataStatus::Old);
}

TEST_F(InputOutput, InputFromOutsideIsConnectedWhileSomebodyWritesIt) {
    Output<double> front{&component, "front"};
    fed = false;
    port().connectOutside(portOf(component, front).slot().get(), &fed);
    EXPECT_FALSE(in.connected(&component));
    fed = true;
    EXPECT_TRUE(in.connected(&component));
    fed = false;
    EXPECT_FALSE(in.connected(&component)) << "the last publisher has ended";
    connect(first);
    EXPECT_TRUE(in.connected(&component)) << "a writer in the loop";
}

TEST_F(InputOutput, ValueOfAWriterStaysUntilAMessageArrives) {
    Output<double> front{&component, "front"};
    write(front, 9.0);
    connect(first);
    write(first, 1.0);
    in.read();
    port().connectOutside(portOf(component, front).slot().get(), &fed);
    EXPECT_EQ(read(), DataStatus::Old);
    EXPECT_EQ(in.value(), 1.0);
    port().inject(portOf(component, front).slot().get());
    EXPECT_EQ(read(), DataStatus::New);
    EXPECT_EQ(in.value(), 9.0);
}

TEST_F(InputOutput, AgeIsLoopTimeSinceTheWrite) {
    connect(first);
    writeAt(first, 1.0, 1000);
    in.read();
    accessTo(component).setTime(3500);
    EXPECT_EQ(in.age(&component), 2500);
}

// A simulated clock restarts.
TEST_F(InputOutput, MoveOfTheTimeKeepsAgesAndNews) {
    Input<double> other{&component, "other"};
    InputPort& other_port = *accessTo(component).inputs().back();
    connect(first);
    other_port.connect(portOf(component, first).slot().get(), false);
    writeAt(first, 1.0, 1'000'000);
    in.read();
    accessTo(component).setTime(1'000'500);
    for (const std::int64_t by : {-1'000'000, -1'000'500, -999'999}) {
        portOf(component, first).slot()->stamp =
            movedStamp(portOf(component, first).slot()->stamp, by);
        port().moveTime(by);
        other_port.moveTime(by);
        accessTo(component).setTime(component.time() + by);
        EXPECT_EQ(in.read(), DataStatus::Old);
        EXPECT_TRUE(other.isNew());
        EXPECT_EQ(in.age(&component), 500);
    }
    write(first, 2.0);
    EXPECT_EQ(in.read(), DataStatus::New);
}

TEST_F(InputOutput, WriteIsStampedWithTheLoopsTime) {
    writeAt(first, 1.0, 42);
    EXPECT_EQ(portOf(component, first).slot()->stamp, 42);
}

TEST_F(InputOutput, SlotOutlivesItsOutput) {
    std::shared_ptr<SlotHeader> slot;
    {
        BareComponent other;
        Output<double> output{&other, "output"};
        output.write(5.0);
        slot = portOf(other, output).slot();
        port().connect(slot.get(), false);
    }
    in.read();
    EXPECT_EQ(in.value(), 5.0);
}

TEST(StagedOutput, ReadersSeeWholeValuesEvenIfACopyFails) {
    BareComponent component;
    Output<Halves> out{&component, "out"};
    Input<Halves> in{&component, "in"};
    portOf(component, out).stage();
    accessTo(component).inputs().front()->connect(portOf(component, out).slot().get(), false);
    out.value().first = out.value().second = {1.0};
    out.publish();
    EXPECT_EQ(in.read(), DataStatus::None);
    EXPECT_TRUE(portOf(component, out).commit());
    EXPECT_EQ(in.read(), DataStatus::New);
    accessTo(component).setTime(component.time() + 1);
    out.value().first = out.value().second = {2.0, 3.0};
    out.publish();
    Halves::copies_throw = true;
    EXPECT_THROW(portOf(component, out).commit(), std::bad_alloc);
    Halves::copies_throw = false;
    in.read();
    EXPECT_EQ(in.value().first, in.value().second);
}

TEST(QueueWithoutMemory, DropsMessagesThatItCannotCopy) {
    BareComponent component;
    Output<Halves> out{&component, "out"};
    Queue<Halves, 2> queue{&component, "queue"};
    accessTo(component).inputs().front()->connect(portOf(component, out).slot().get(), false);
    Halves::copies_throw = true;
    out.publish();
    EXPECT_EQ(queue.size(), 0U);
    EXPECT_EQ(queue.dropped(), 1U);
    Halves::copies_throw = false;
    accessTo(component).setTime(component.time() + 1);
    out.publish();
    EXPECT_EQ(queue.size(), 1U);
}

TEST(StagedOutput, ComponentContinuesFromTheValueThatItWrote) {
    BareComponent component;
    Output<std::vector<int>> out{&component, "out"};
    out.reserve(std::vector<int>(100));
    portOf(component, out).stage();
    const auto& seen =
        static_cast<const Slot<std::vector<int>>&>(*portOf(component, out).slot()).value;
    out.write({1});
    EXPECT_TRUE(portOf(component, out).commit());
    accessTo(component).setTime(component.time() + 1);
    out.value().push_back(2);
    out.publish();
    EXPECT_EQ(seen, std::vector<int>({1}));
    EXPECT_TRUE(portOf(component, out).commit());
    EXPECT_EQ(seen, std::vector<int>({1, 2}));
    EXPECT_EQ(out.value(), seen);
    out.value().push_back(3);
    portOf(component, out).takeBack();
    EXPECT_EQ(out.value(), std::vector<int>({1, 2}));
    EXPECT_GE(out.value().capacity(), 100U);
    EXPECT_GE(seen.capacity(), 100U);
}

TEST(Declaration, OfATakenNameIsRefused) {
    BareComponent component;
    const Input<double> in{&component, "x"};
    const auto again = [&] { const Output<double> out{&component, "x"}; };
    EXPECT_THROW(again(), std::logic_error);
}

TEST(Declaration, OfAPortHasAUnitAndAMeaning) {
    BareComponent component;
    const Input<double> in{&component, "in", "rad", "measured angle"};
    const Queue<double, 2> queue{&component, "queue", "m", "way points"};
    const Output<double> out{&component, "out", "N m", "to the drive"};
    const Output<double> finite{&component, "finite", "N", Finite(), "checked"};
    const Output<double> plain{&component, "plain"};
    std::vector<std::string> told;
    for (const InputPort* each : accessTo(component).inputs())
        told.push_back(each->texts().unit + ": " + each->texts().doc);
    for (const OutputPort* each : accessTo(component).outputs())
        told.push_back(each->unit() + ": " + each->texts().doc);
    EXPECT_EQ(told, (std::vector<std::string>{"rad: measured angle", "m: way points",
                                              "N m: to the drive", "N: checked", ": "}));
}

TEST(Declaration, OfAnIllegalNameIsRefused) {
    BareComponent component;
    for (const char* name : {"", "1x", "a/b", "a-b", "_x", "~x"}) {
        const auto declare = [&] { const Input<double> in{&component, name}; };
        EXPECT_THROW(declare(), std::logic_error) << name;
    }
}

TEST(Declaration, AfterFreezeIsRefused) {
    BareComponent component;
    accessTo(component).freeze();
    const auto declare = [&] { const Input<double> in{&component, "in"}; };
    EXPECT_THROW(declare(), std::logic_error);
}

TEST(Declaration, ParametersAndPortsMayShareAName) {
    BareComponent component;
    const Input<double> in{&component, "x"};
    EXPECT_NO_THROW((Parameter<double>{&component, "x", 0.0}));
}

}  // namespace
}  // namespace rtcf::test
