// Inputs and outputs wired by hand, as by the loop at a cycle boundary.
#include <gtest/gtest.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>

#include <new>
#include <stdexcept>
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

class InputOutput : public ::testing::Test {
   protected:
    void connect(OutputBase& output) { in.rewire(output.slot().get(), false); }
    void writeAt(Output<double>& output, double value, std::int64_t time_ns) {
        component.loop_clock.time_ns = time_ns;
        output.write(value);
    }

    BareComponent component;
    Input<double> in{&component, "in"};
    Output<double> first{&component, "first"};
    Output<double> second{&component, "second"};
};

TEST_F(InputOutput, UnconnectedInputHasNoData) {
    EXPECT_FALSE(in.connected());
    EXPECT_EQ(in.read(), DataStatus::None);
    EXPECT_EQ(in.value(), 0.0);
    EXPECT_EQ(in.age(), -1);
}

TEST_F(InputOutput, ValueIsNewOnceAndThenOld) {
    connect(first);
    EXPECT_EQ(in.read(), DataStatus::None);
    first.write(1.5);
    EXPECT_EQ(in.read(), DataStatus::New);
    EXPECT_EQ(in.value(), 1.5);
    EXPECT_EQ(in.read(), DataStatus::Old);
    first.write(1.5);
    EXPECT_EQ(in.read(), DataStatus::New) << "a write is new even if the value is equal";
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

TEST_F(InputOutput, RewiredInputKeepsItsValueUntilTheNewWriterWrites) {
    second.write(9.0);
    connect(first);
    first.write(1.0);
    in.read();
    connect(second);
    EXPECT_EQ(in.read(), DataStatus::Old);
    EXPECT_EQ(in.value(), 1.0);
    second.write(2.0);
    EXPECT_EQ(in.read(), DataStatus::New);
    EXPECT_EQ(in.value(), 2.0);
}

TEST_F(InputOutput, ContinuedConnectionKeepsReadAndUnreadValues) {
    Output<double> copy{&component, "copy"};
    connect(first);
    first.write(1.0);
    in.read();
    first.type().copy(*copy.slot(), *first.slot());
    in.rewire(copy.slot().get(), true);
    EXPECT_EQ(in.read(), DataStatus::Old) << "the write was read before";
    EXPECT_EQ(in.value(), 1.0);
    first.write(2.0);
    first.type().copy(*copy.slot(), *first.slot());
    in.rewire(first.slot().get(), true);
    EXPECT_EQ(in.read(), DataStatus::New);
    EXPECT_EQ(in.value(), 2.0);
}

TEST_F(InputOutput, ContinuedConnectionKeepsAnEarlierWritersValueToo) {
    Output<double> copy{&component, "copy"};
    second.write(9.0);
    connect(first);
    first.write(1.0);
    in.read();
    connect(second);
    first.type().copy(*copy.slot(), *second.slot());
    in.rewire(copy.slot().get(), true);
    EXPECT_EQ(in.read(), DataStatus::Old);
    EXPECT_EQ(in.value(), 1.0) << "the new writer has not written yet";
}

TEST_F(InputOutput, DisconnectedInputKeepsItsValueAsOldData) {
    connect(first);
    first.write(1.0);
    in.read();
    in.disconnect();
    EXPECT_FALSE(in.connected());
    EXPECT_EQ(in.read(), DataStatus::Old);
    EXPECT_EQ(in.value(), 1.0);
}

TEST_F(InputOutput, InjectedValueIsNewAndMayMoveToAnotherSlot) {
    Output<double> front{&component, "front"};
    Output<double> next{&component, "next"};
    in.rewire(front.slot().get(), false);
    front.write(1.0);
    in.inject(front.slot().get());
    EXPECT_EQ(in.read(), DataStatus::New);
    next.write(0.0);
    next.write(2.0);  // the second value from outside
    in.inject(next.slot().get());
    EXPECT_EQ(in.value(), 2.0) << "the first slot may be overwritten from here on";
    EXPECT_EQ(in.read(), DataStatus::New);
    EXPECT_EQ(in.read(), DataStatus::Old);
}

TEST_F(InputOutput, AgeIsLoopTimeSinceTheWrite) {
    connect(first);
    writeAt(first, 1.0, 1000);
    in.read();
    component.loop_clock.time_ns = 3500;
    EXPECT_EQ(in.age(), 2500);
}

TEST_F(InputOutput, AgeIsNeverNegative) {
    connect(first);
    writeAt(first, 1.0, 1'000'000);
    in.read();
    component.loop_clock.time_ns = 0;  // a simulated clock restarts
    EXPECT_EQ(in.age(), 0);
}

TEST_F(InputOutput, NewestIsTheUnreadValue) {
    connect(first);
    first.write(1.0);
    EXPECT_EQ(&in.newest(), first.slot().get());
    in.read();
    EXPECT_EQ(&in.newest(), first.slot().get());
    EXPECT_EQ(in.seen(), 1U);
}

TEST_F(InputOutput, WriteIsStampedWithTheLoopsClock) {
    writeAt(first, 1.0, 42);
    EXPECT_EQ(first.slot()->sequence, 1U);
    EXPECT_EQ(first.slot()->time_ns, 42);
}

TEST_F(InputOutput, SlotOutlivesItsOutput) {
    std::shared_ptr<SlotHeader> slot;
    {
        BareComponent other;
        Output<double> output{&other, "output"};
        output.write(5.0);
        slot = output.slot();
        in.rewire(slot.get(), false);
    }
    in.read();
    EXPECT_EQ(in.value(), 5.0);
}

TEST(StagedOutput, ReadersSeeWholeValuesEvenIfACopyFails) {
    BareComponent component;
    Output<Halves> out{&component, "out"};
    Input<Halves> in{&component, "in"};
    out.stage();
    in.rewire(out.slot().get(), false);
    out.value().first = out.value().second = {1.0};
    out.publish();
    EXPECT_EQ(in.read(), DataStatus::None);
    EXPECT_TRUE(out.commit());
    EXPECT_EQ(in.read(), DataStatus::New);
    out.value().first = out.value().second = {2.0, 3.0};
    out.publish();
    Halves::copies_throw = true;
    EXPECT_THROW(out.commit(), std::bad_alloc);
    Halves::copies_throw = false;
    in.read();
    EXPECT_EQ(in.value().first, in.value().second);
}

TEST(QueueWithoutMemory, DropsMessagesThatItCannotCopy) {
    BareComponent component;
    Output<Halves> out{&component, "out"};
    Queue<Halves, 2> queue{&component, "queue"};
    queue.rewire(out.slot().get(), false);
    Halves::copies_throw = true;
    out.publish();
    EXPECT_EQ(queue.size(), 0U);
    EXPECT_EQ(queue.dropped(), 1U);
    Halves::copies_throw = false;
    out.publish();
    EXPECT_EQ(queue.size(), 1U);
}

TEST(StagedOutput, ComponentContinuesFromTheValueThatItWrote) {
    BareComponent component;
    Output<std::vector<int>> out{&component, "out"};
    out.reserve(std::vector<int>(100));
    out.stage();
    const auto& seen = static_cast<const Slot<std::vector<int>>&>(*out.slot()).value;
    out.write({1});
    EXPECT_TRUE(out.commit());
    out.value().push_back(2);
    out.publish();
    EXPECT_EQ(seen, std::vector<int>({1}));
    EXPECT_TRUE(out.commit());
    EXPECT_EQ(seen, std::vector<int>({1, 2}));
    EXPECT_EQ(out.value(), seen);
    out.value().push_back(3);
    out.takeBack();
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

TEST(Declaration, OfAnIllegalNameIsRefused) {
    BareComponent component;
    for (const char* name : {"", "1x", "a/b", "a-b", "_x", "~x"}) {
        const auto declare = [&] { const Input<double> in{&component, name}; };
        EXPECT_THROW(declare(), std::logic_error) << name;
    }
}

TEST(Declaration, AfterFreezeIsRefused) {
    BareComponent component;
    component.freeze();
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
