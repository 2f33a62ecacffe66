#include <dlfcn.h>
#include <netdb.h>
#include <ros/node_handle.h>
#include <std_msgs/Int32.h>

#include <atomic>
#include <csignal>
#include <thread>

#include <rtcf/read_number.hpp>

#include "ros/roscpp/node_name.hpp"
#include "ros_fixture.hpp"

class RosNodeTest : public RosFixture {
   protected:
    // Settings with latching for topics whose names match `latch`.
    rtcf::executor::BridgeSettings latched(const std::string& latch) const {
        rtcf::executor::BridgeSettings settings;
        settings.master_uri = masterUri();
        settings.latch = latch;
        return settings;
    }
};

// Until then the resolver below does not answer.
std::atomic<bool> resolver_answers{false};

// Replaces the C library's function: for this name, it is as slow as resolvers can be.
extern "C" int getaddrinfo(const char* node, const char* service, const addrinfo* hints,
                           addrinfo** found) {
    using Function = int (*)(const char*, const char*, const addrinfo*, addrinfo**);
    static const auto real = reinterpret_cast<Function>(dlsym(RTLD_NEXT, "getaddrinfo"));
    if (node != nullptr && std::string(node) == "slow.example") {
        while (!resolver_answers) std::this_thread::sleep_for(10ms);
        return EAI_NONAME;
    }
    return real(node, service, hints, found);
}

TEST_F(RosNodeTest, ValuesFlowBothWays) {
    startMaster();
    Source source("/out");
    Sink sink("/in");
    startNode();
    serve({&source}, {&sink});
    const auto listener = listen("/out");
    const auto sender = send("/in", 2.5);
    EXPECT_NE(flow(source, *listener), "");
    EXPECT_TRUE(eventually([&] { return sink.value() == 2.5; }));
    const auto status = rosNode().status();
    EXPECT_TRUE(status.enabled && status.connected);
    EXPECT_EQ(status.publications, 1U);
    EXPECT_EQ(status.subscriptions, 1U);
    EXPECT_EQ(status.problem, "");
    EXPECT_EQ(status.master_uri, masterUri());
}

TEST_F(RosNodeTest, NoValueIsLostOrReordered) {
    startMaster();
    Source source("/out");
    startNode();
    serve({&source}, {});
    const auto listener = listen("/out");
    double last = rtcf::readNumber(flow(source, *listener)).value();
    while (const auto line = listener->line(300ms)) last = rtcf::readNumber(*line).value();
    for (int i = 1; i <= 2000; ++i) {
        source.write(last + i);
        if (i % 20 == 0) std::this_thread::sleep_for(10ms);
    }
    for (int i = 1; i <= 2000; ++i) {
        const auto line = listener->line(5s);
        ASSERT_TRUE(line) << "after " << i - 1;
        ASSERT_EQ(rtcf::readNumber(*line), last + i);
    }
}

TEST_F(RosNodeTest, WaitsForAMaster) {
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return reported("no ROS master"); }));
    EXPECT_FALSE(rosNode().status().connected);
    EXPECT_NE(rosNode().status().problem.find(masterUri()), std::string::npos);
    // Values are not sent, and still the tap does not fill up.
    for (int i = 0; i < 10000; ++i) {
        source.write(i);
        if (i % 100 == 0) std::this_thread::sleep_for(2ms);
    }
    EXPECT_EQ(source.tap()->dropped(), 0U);
    startMaster();
    EXPECT_TRUE(eventually([&] { return rosNode().status().publications == 1; }));
    EXPECT_TRUE(eventually([&] { return rosNode().status().connected; }));
    const auto listener = listen("/out");
    EXPECT_NE(flow(source, *listener), "");
}

TEST_F(RosNodeTest, RegistersAgainWithARestartedMaster) {
    startMaster();
    Source source("/out");
    Sink sink("/in");
    startNode();
    serve({&source}, {&sink});
    const auto old_listener = listen("/out");
    ASSERT_NE(flow(source, *old_listener), "");
    stopMaster();
    ASSERT_TRUE(eventually([&] { return !rosNode().status().connected; }));
    // Existing connections do not need the master.
    while (old_listener->line(100ms)) {
    }
    EXPECT_NE(flow(source, *old_listener), "");
    startMaster();
    EXPECT_TRUE(eventually([&] { return rosNode().status().connected; }));
    EXPECT_TRUE(eventually([&] { return reported("registered again"); }));
    const auto listener = listen("/out");
    const auto sender = send("/in", 7.0);
    EXPECT_NE(flow(source, *listener), "");
    EXPECT_TRUE(eventually([&] { return sink.value() == 7.0; }));
    EXPECT_NE(run({"rosnode", "info", rosNode().status().node}).find("/set_logger_level"),
              std::string::npos);
}

TEST_F(RosNodeTest, FindsPublishersRegisteredBeforeIt) {
    startMaster();
    Sink sink("/in");
    startNode();
    serve({}, {&sink});
    ASSERT_TRUE(eventually([&] { return rosNode().status().subscriptions == 1; }));
    // A sender registers with the new master first, before our node notices it.
    stopMaster();
    ASSERT_TRUE(eventually([&] { return !rosNode().status().connected; }));
    startMaster();
    const auto sender = send("/in", 3.0);
    EXPECT_TRUE(eventually([&] { return sink.value() == 3.0; }));
}

TEST_F(RosNodeTest, OpensAndClosesWithTheTable) {
    startMaster();
    Source first("/first");
    Source second("/second");
    Sink sink("/in");
    startNode();
    serve({&first}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().publications == 1; }));
    const auto listener = listen("/first");
    ASSERT_NE(flow(first, *listener), "");
    serve({&first, &second}, {&sink});
    ASSERT_TRUE(eventually([&] {
        return rosNode().status().publications == 2 && rosNode().status().subscriptions == 1;
    }));
    const auto other = listen("/second");
    EXPECT_NE(flow(second, *other), "");
    while (listener->line(100ms)) {
    }
    EXPECT_NE(flow(first, *listener), "");
    serve({&second}, {});
    ASSERT_TRUE(eventually([&] {
        return rosNode().status().publications == 1 && rosNode().status().subscriptions == 0;
    }));
    std::string text;
    EXPECT_TRUE(eventually([&] {
        text = run({"rosnode", "info", rosNode().status().node});
        return text.find("/first") == std::string::npos && text.find("/in") == std::string::npos;
    })) << text;
    EXPECT_NE(text.find("/second"), std::string::npos) << text;
}

TEST_F(RosNodeTest, ANewTapOfATopicKeepsItsSubscribers) {
    startMaster();
    Source before("/out");
    startNode();
    serve({&before}, {});
    const auto listener = listen("/out");
    ASSERT_NE(flow(before, *listener), "");
    while (listener->line(200ms)) {
    }
    Source after("/out");
    serve({&after}, {});
    // The connection stays, so that even the first value is not lost.
    after.write(77.0);
    EXPECT_EQ(listener->line(5s).value_or("none"), "77.0");
}

TEST_F(RosNodeTest, ANewInjectorOfATopicGetsTheLatchedValue) {
    startMaster();
    Sink before("/in");
    startNode();
    serve({}, {&before});
    const auto sender = send("/in", 4.0);
    ASSERT_TRUE(eventually([&] { return before.value() == 4.0; }));
    Sink after("/in");
    serve({}, {&after});
    EXPECT_TRUE(eventually([&] { return after.value() == 4.0; }));
    // Nor does it need a master.
    stopMaster();
    ASSERT_TRUE(eventually([&] { return !rosNode().status().connected; }));
    Sink late("/in");
    serve({}, {&late});
    EXPECT_TRUE(eventually([&] { return late.value() == 4.0; }));
}

TEST_F(RosNodeTest, ARefusedConnectionShowsInTheStatus) {
    startMaster();
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().publications == 1; }));
    const auto listener = listen("/out", "std_msgs/Int32");
    EXPECT_TRUE(eventually([&] {
        return rosNode().status().problem.find("std_msgs/Int32") != std::string::npos;
    })) << rosNode().status().problem;
    EXPECT_TRUE(eventually([&] { return reported("/out"); }));
}

TEST_F(RosNodeTest, YieldsToANodeOfItsNameAndReturns) {
    startMaster();
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    auto twin = node(rosNode().status().node);
    ASSERT_EQ(twin->line(10s).value_or(""), "ready");
    EXPECT_TRUE(eventually([&] {
        return rosNode().status().problem.find("another node named") != std::string::npos;
    }));
    EXPECT_TRUE(eventually([&] { return rosNode().status().publications == 0; }));
    EXPECT_TRUE(eventually([&] { return reported("another node named"); }));
    // It ends without unregistering, so the master still knows it.
    twin.reset();
    EXPECT_TRUE(eventually([&] { return rosNode().status().connected; }));
    const auto listener = listen("/out");
    EXPECT_NE(flow(source, *listener), "");
}

TEST_F(RosNodeTest, StaysDownOnceKilledUntilConfiguredAgain) {
    startMaster();
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    run({"rosnode", "kill", rosNode().status().node});
    EXPECT_TRUE(eventually([&] { return reported("received a shutdown request"); }));
    EXPECT_EQ(rosNode().status().publications, 0U);
    rtcf::executor::BridgeSettings settings;
    settings.master_uri = masterUri();
    rosNode().configure(settings);
    EXPECT_TRUE(eventually([&] { return rosNode().status().connected; }));
    const auto listener = listen("/out");
    EXPECT_NE(flow(source, *listener), "");
}

TEST_F(RosNodeTest, ReturnsAtANewMasterOnceKilled) {
    startMaster();
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    run({"rosnode", "kill", rosNode().status().node});
    ASSERT_TRUE(eventually([&] { return reported("received a shutdown request"); }));
    stopMaster();
    startMaster();
    EXPECT_TRUE(eventually([&] { return rosNode().status().connected; }));
    const auto listener = listen("/out");
    EXPECT_NE(flow(source, *listener), "");
}

TEST_F(RosNodeTest, TakesNoNameInUse) {
    startMaster();
    const std::string name = rtcf::ros1::nodeName("", "rt_runner").full();
    auto twin = node(name);
    ASSERT_EQ(twin->line(10s).value_or(""), "ready");
    startNode();
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    EXPECT_EQ(rosNode().status().node, name + "_2");
    EXPECT_TRUE(eventually([&] { return reported("this one is " + name + "_2"); }));
    EXPECT_NE(run({"rosnode", "ping", "-c1", name}).find("reply"), std::string::npos);
}

TEST_F(RosNodeTest, KeepsLatchedValuesAcrossAnInterruption) {
    startMaster();
    Source source("/out");
    startNode();
    rtcf::executor::BridgeSettings settings = latched("/out");
    rosNode().configure(settings);
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().publications == 1; }));
    source.write(3.5);
    ASSERT_EQ(listen("/out")->line(20s).value_or(""), "3.5");
    settings.queue = 7;
    rosNode().configure(settings);
    EXPECT_EQ(listen("/out")->line(20s).value_or(""), "3.5");
    settings.enabled = false;
    rosNode().configure(settings);
    ASSERT_TRUE(eventually([&] { return rosNode().status().publications == 0; }));
    settings.enabled = true;
    rosNode().configure(settings);
    EXPECT_EQ(listen("/out")->line(20s).value_or(""), "3.5");
}

// Between a component's load and the node's next check of its master.
TEST_F(RosNodeTest, KeepsTheOnlyValueOfALatchedTopic) {
    startMaster();
    startNode();
    rtcf::executor::BridgeSettings settings = latched("/out.*");
    rosNode().configure(settings);
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    for (int i = 0; i < 5; ++i) {
        const std::string topic = "/out" + std::to_string(i);
        Source source(topic);
        serve({&source}, {});
        source.write(3.5);
        EXPECT_EQ(listen(topic)->line(20s).value_or(""), "3.5") << i;
    }
}

// Written at a random time during the change.
TEST_F(RosNodeTest, ALatchedValueSurvivesAChangeOfItsSettings) {
    startMaster();
    Source source("/out");
    startNode();
    rtcf::executor::BridgeSettings settings = latched("/out");
    rosNode().configure(settings);
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().publications == 1; }));
    double value = 0.0;
    for (int i = 0; i < 10; ++i) {
        settings.queue = 7 + static_cast<std::uint32_t>(i);
        rosNode().configure(settings);
        for (int j = 0; j <= i; ++j) {
            source.write(++value);
            std::this_thread::sleep_for(50us);
        }
        const auto listener = listen("/out");
        std::string last;
        while (last != std::to_string(static_cast<int>(value)) + ".0") {
            const auto line = listener->line(20s);
            ASSERT_TRUE(line) << "only " << last << " of " << value;
            last = *line;
        }
    }
}

TEST_F(RosNodeTest, PublishesNumbersWithTheTimeOfTheirCycleIfAsked) {
    startMaster();
    Source source("/out");
    Source plain("/plain");
    startNode();
    rtcf::executor::BridgeSettings settings;
    settings.master_uri = masterUri();
    settings.latch = "/out";
    settings.stamped = "/out";
    rosNode().configure(settings);
    serve({&source, &plain}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().publications == 2; }));
    source.write(3.5, 1'700'000'000'123'456'789);
    const std::string stamped = "1700000000123456789 3.5";
    EXPECT_EQ(listen("/out", "rtcf_msgs/Float64Stamped")->line(20s).value_or(""), stamped);
    EXPECT_NE(flow(plain, *listen("/plain")), "");
    // Values for late subscribers keep their stamp when the topic is reopened.
    settings.queue = 7;
    rosNode().configure(settings);
    EXPECT_EQ(listen("/out", "rtcf_msgs/Float64Stamped")->line(20s).value_or(""), stamped);
    // Switched back while the loop runs: no stamped message goes to subscribers without a header.
    settings.stamped = "";
    rosNode().configure(settings);
    const auto listener = listen("/out");
    EXPECT_NE(flow(source, *listener), "");
}

TEST_F(RosNodeTest, OpensFailedTopicsLater) {
    startMaster();
    Source source("/out");
    startNode();
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    {
        ros::NodeHandle handle("/");
        ros::Publisher other = handle.advertise<std_msgs::Int32>("/out", 1);
        serve({&source}, {});
        ASSERT_TRUE(eventually([&] {
            return rosNode().status().problem.find("cannot publish /out") != std::string::npos;
        }));
    }
    EXPECT_TRUE(eventually([&] { return rosNode().status().publications == 1; }));
    EXPECT_TRUE(eventually([&] { return rosNode().status().problem.empty(); }));
    const auto listener = listen("/out");
    EXPECT_NE(flow(source, *listener), "");
}

TEST_F(RosNodeTest, FollowsItsSettings) {
    startMaster();
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    rtcf::executor::BridgeSettings settings;
    settings.enabled = false;
    rosNode().configure(settings);
    EXPECT_TRUE(eventually([&] { return rosNode().status().publications == 0; }));
    EXPECT_FALSE(rosNode().status().enabled);
    settings.enabled = true;
    settings.master_uri = "nonsense";
    rosNode().configure(settings);
    EXPECT_TRUE(eventually(
        [&] { return rosNode().status().problem.find("http://HOST:PORT") != std::string::npos; }));
    settings.master_uri = "http://127.0.0.1:1";
    rosNode().configure(settings);
    EXPECT_TRUE(eventually([&] {
        return rosNode().status().problem.find("no ROS master answers") != std::string::npos;
    }));
    settings.master_uri = masterUri();
    settings.queue = 10;
    rosNode().configure(settings);
    EXPECT_TRUE(eventually([&] { return rosNode().status().connected; }));
    const auto listener = listen("/out");
    EXPECT_NE(flow(source, *listener), "");
}

TEST_F(RosNodeTest, QueryingItsLoggersDoesNotCrashIt) {
    startMaster();
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    EXPECT_EQ(lookAtLoggers(), "done\n");
    // These make roscpp log.
    const auto wrong = listen("/out", "std_msgs/Int32");
    EXPECT_TRUE(eventually([&] { return !rosNode().status().problem.empty(); }));
    const auto listener = listen("/out");
    EXPECT_NE(flow(source, *listener), "");
}

TEST_F(RosNodeTest, EndsQuicklyWithoutAMaster) {
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return reported("no ROS master"); }));
    EXPECT_TRUE(nodeEnds());
}

TEST_F(RosNodeTest, EndsQuicklyAfterItsMasterEnded) {
    startMaster();
    Source source("/out");
    Sink sink("/in");
    startNode();
    serve({&source}, {&sink});
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    stopMaster();
    EXPECT_TRUE(nodeEnds());
}

TEST_F(RosNodeTest, EndsQuicklyWithAHangingMaster) {
    startMaster();
    Source source("/out");
    Sink sink("/in");
    startNode();
    serve({&source}, {&sink});
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    master().signal(SIGSTOP);
    // Waiting for the master for each of them would take a minute.
    std::vector<std::unique_ptr<Source>> sources;
    std::vector<Source*> others;
    for (int i = 0; i < 60; ++i) {
        sources.push_back(std::make_unique<Source>("/other" + std::to_string(i)));
        others.push_back(sources.back().get());
    }
    serve(others, {});
    EXPECT_TRUE(nodeEnds());
}

// The process must end, too, which roscpp's exit handler would prevent.
TEST_F(RosNodeTest, EndsQuicklyWithAMasterThatHangsInACall) {
    startDeafMaster();
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_EQ(master().line(10s).value_or(""), "asked");
    EXPECT_TRUE(nodeEnds());
}

// Its time is spent on one answer that does not arrive, not on repeated calls.
TEST_F(RosNodeTest, CallsAHangingMasterOnlyOnceBeforeItsEnd) {
    startDeafMaster();
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_EQ(master().line(10s).value_or(""), "asked");
    stopNode();
    int asked = 0;
    while (master().line(100ms)) ++asked;
    EXPECT_LE(asked, 1);
}

TEST_F(RosNodeTest, LeavesNothingAtASlowMaster) {
    startSlowMaster(100ms);
    std::vector<std::unique_ptr<Source>> sources;
    std::vector<std::unique_ptr<Sink>> sinks;
    std::vector<Source*> outputs;
    std::vector<Sink*> inputs;
    for (int i = 0; i < 20; ++i) {
        sources.push_back(std::make_unique<Source>("/out" + std::to_string(i)));
        sinks.push_back(std::make_unique<Sink>("/in" + std::to_string(i)));
        outputs.push_back(sources.back().get());
        inputs.push_back(sinks.back().get());
    }
    startNode();
    serve(outputs, inputs);
    ASSERT_TRUE(eventually([&] { return rosNode().status().subscriptions == 20; }));
    const std::string name = rosNode().status().node;
    ASSERT_TRUE(eventually(
        [&] { return run({"rosnode", "info", name}).find("/in19") != std::string::npos; }));
    // Like a graph that is removed right before the end.
    serve({}, {});
    stopNode();
    // One after the other would exceed the available time.
    int most_at_once = 0;
    while (const auto line = master().line(100ms)) most_at_once = std::stoi(*line);
    EXPECT_GE(most_at_once, 4);
    // On a machine that is too busy, the node reports the remaining registrations.
    const bool left = run({"rosnode", "list"}).find(name) != std::string::npos;
    EXPECT_TRUE(!left || reported("may be left"));
}

// The answer to a registration is outdated once the master has sent newer data. Here all answers
// are processed when the last one has arrived, seconds after the first.
TEST_F(RosNodeTest, KeepsAPublisherThatRegisteredDuringARegistration) {
    startSlowMaster(500ms);
    Sink sink("/a");  // registered first
    std::vector<std::unique_ptr<Sink>> others;
    std::vector<Sink*> inputs{&sink};
    for (int i = 0; i < 100; ++i) {  // 7 rounds of 16 at a time: 3.5 s
        others.push_back(std::make_unique<Sink>("/in" + std::to_string(i)));
        inputs.push_back(others.back().get());
    }
    startNode();
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    serve({}, inputs);
    // Each would need five calls of half a second if roscpp were not answered from memory.
    ASSERT_TRUE(eventually([&] { return rosNode().status().subscriptions == 101; }));
    const auto counter = count("/a");  // registers within about a second
    ASSERT_TRUE(eventually([&] { return sink.value() > 0.0; }));
    const std::string name = rosNode().status().node;
    ASSERT_TRUE(eventually(
        [&] { return run({"rosnode", "info", name}).find("/in99") != std::string::npos; }));
    // The master knows the last one; its answer arrives half a second later.
    const double then = sink.value();
    EXPECT_TRUE(eventually([&] { return sink.value() > then + 40.0; }, 10s))
        << "it was cut off at " << sink.value();
}

TEST_F(RosNodeTest, ReportsRegistrationsLeftAtAHangingMaster) {
    startMaster();
    Source source("/out");
    startNode();
    serve({&source}, {});
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    master().signal(SIGSTOP);
    stopNode();
    EXPECT_TRUE(reported("registrations of ROS node"));
    EXPECT_TRUE(reported("may be left"));
}

// A slow resolver in place of the C library's.
TEST_F(RosNodeTest, DoesNotWaitForASlowResolver) {
    startMaster();
    startNode();
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    rtcf::executor::BridgeSettings settings;
    settings.master_uri = "http://slow.example:11311";
    rosNode().configure(settings);
    EXPECT_TRUE(eventually([&] {
        return rosNode().status().problem.find("'slow.example' has no address") !=
               std::string::npos;
    }));
    EXPECT_TRUE(nodeEnds());
    resolver_answers = true;
}

TEST_F(RosNodeTest, LeavesNothingAtTheMaster) {
    startMaster();
    Source source("/out");
    Sink sink("/in");
    startNode();
    serve({&source}, {&sink});
    ASSERT_TRUE(eventually([&] { return rosNode().status().connected; }));
    const std::string name = rosNode().status().node;
    stopNode();
    EXPECT_EQ(run({"rosnode", "list"}).find(name), std::string::npos);
}
