// The executor's socket, from connect() on, with a real runner.
#include "server/server.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "components/journal.hpp"
#include "faults/flight_recorder.hpp"
#include "support/eventually.hpp"
#include "support/executor_client.hpp"
#include "support/temporary_folder.hpp"

namespace rtcf::test {
namespace {

using executor::v1::Request;
using executor::v1::Response;

Request getStatus() {
    Request request;
    request.mutable_get_status();
    return request;
}

Request load(const std::string& type, const std::string& name) {
    Request request;
    request.mutable_load()->set_library(RTCF_UNIT_COMPONENTS "/rtcf_unit_test.so");
    rtcf::v1::ComponentSpec& component = *request.mutable_load()->mutable_component();
    component.set_type(type);
    component.set_name(name);
    component.set_package("rtcf_unit_test");
    return request;
}

Request unload(const std::string& name) {
    Request request;
    request.mutable_unload()->add_components(name);
    return request;
}

Request blocker(const std::string& hook) {
    Request loading = load("Blocker", "B");
    rtcf::v1::ParameterSetting& blocks =
        *loading.mutable_load()->mutable_component()->add_parameters();
    blocks.set_name("blocks");
    blocks.mutable_value()->set_string_value(hook);
    return loading;
}

Request hookTimeout(double seconds) {
    Request request;
    request.mutable_configure()->set_hook_timeout_s(seconds);
    return request;
}

Request start() {
    Request request;
    request.mutable_start();
    return request;
}

class ServerTest : public ::testing::Test {
   protected:
    ServerTest() {
        journal().clear();
        thread_ = std::thread([this] { server_.serve(runner_, log_, access_, direct_stop_); });
    }

    ~ServerTest() override {
        journal().gate_open = true;
        // The test's clients have disconnected, so that there is room for this one.
        EXPECT_TRUE(eventually([this] {
            ExecutorClient last(socket_);
            Request hello;
            hello.mutable_hello();
            last.send(hello);
            Request exit;
            exit.mutable_exit();
            last.send(exit);
            const auto answer = last.receive();
            return answer.has_value() && answer->has_hello();
        }));
        thread_.join();
    }

    static rtcf_unit_test::Journal& journal() { return *rtcf_unit_test_journal(); }

    const TemporaryFolder folder_;
    const std::string socket_ = folder_.path("executor.sock");
    executor::Server server_{socket_};
    executor::Log log_{[this](executor::LogEntry&& entry) { server_.publish(entry); }};
    executor::FlightRecorder recorder_;
    executor::Runner runner_{"rt_runner", log_,
                             [this](const executor::RunnerEvent& event) { server_.publish(event); },
                             nullptr, recorder_};
    executor::Access access_;
    executor::DirectStop direct_stop_{"", "", access_};
    std::thread thread_;
};

TEST_F(ServerTest, HelloReportsRunnerAndProtocol) {
    ExecutorClient client(socket_);
    Request request;
    request.mutable_hello()->set_protocol(1);
    const Response response = client.ask(request);
    EXPECT_EQ(response.hello().protocol(), 4U);
    EXPECT_EQ(response.hello().runner(), "rt_runner");
    EXPECT_EQ(response.hello().pid(), ::getpid());
}

TEST_F(ServerTest, NothingIsAnsweredBeforeHello) {
    ExecutorClient client(socket_);
    const Response response = client.ask(getStatus());
    ASSERT_TRUE(response.has_error());
    EXPECT_EQ(response.error().message(), "the first request must be hello");
    client.hello();
    EXPECT_TRUE(client.ask(getStatus()).has_status());
}

// A reader closes the connection for a message above the maximum size.
TEST_F(ServerTest, AnswerAboveTheMaximumSizeIsReplacedByAnError) {
    ExecutorClient client(socket_);
    client.hello();
    Request large = load("Recorder", "L");
    auto& parameter = *large.mutable_load()->mutable_component()->add_parameters();
    parameter.set_name("refuses");
    parameter.mutable_value()->set_string_value(std::string(9 * 1024 * 1024, 'x'));
    ASSERT_TRUE(client.ask(large).has_change());
    Request list;
    list.mutable_list_components();
    const Response response = client.ask(list);
    ASSERT_TRUE(response.has_error());
    EXPECT_EQ(response.error().code(), executor::v1::Error::CODE_RESOURCE_EXHAUSTED);
    EXPECT_NE(response.error().message().find("components of runner rt_runner take"),
              std::string::npos)
        << response.error().message();
    ASSERT_TRUE(client.ask(unload("L")).has_change());
    EXPECT_TRUE(client.ask(list).has_components());
}

TEST_F(ServerTest, MessageMayArriveInPieces) {
    ExecutorClient client(socket_);
    client.hello();
    Request request = getStatus();
    request.set_id(77);
    for (const char byte : ExecutorClient::frame(request)) client.sendBytes(std::string(1, byte));
    EXPECT_TRUE(client.answerTo(77).has_status());
}

TEST_F(ServerTest, ManyMessagesMayArriveAtOnce) {
    ExecutorClient client(socket_);
    client.hello();
    std::string bytes;
    for (std::uint64_t id = 1000; id < 1100; ++id) {
        Request request = getStatus();
        request.set_id(id);
        bytes += ExecutorClient::frame(request);
    }
    client.sendBytes(bytes);
    for (std::uint64_t id = 1000; id < 1100; ++id) {
        const auto response = client.receive();
        ASSERT_TRUE(response.has_value());
        EXPECT_EQ(response->id(), id);
    }
}

TEST_F(ServerTest, TooLargeMessageEndsTheConnection) {
    ExecutorClient client(socket_);
    client.hello();
    client.sendBytes(std::string("\x01\x00\x00\x01", 4));  // 16 MiB plus one byte
    EXPECT_TRUE(client.isClosed());
}

TEST_F(ServerTest, GarbageEndsTheConnectionAndNoOther) {
    ExecutorClient other(socket_);
    other.hello();
    ExecutorClient client(socket_);
    client.hello();
    client.sendBytes(std::string("\x04\x00\x00\x00\xff\xff\xff\xff", 8));
    EXPECT_TRUE(client.isClosed());
    EXPECT_TRUE(other.ask(getStatus()).has_status());
}

TEST_F(ServerTest, RequestOfUnknownKindIsRejected) {
    ExecutorClient client(socket_);
    client.hello();
    EXPECT_TRUE(client.ask(Request()).has_error());
}

TEST_F(ServerTest, PeersBeyondTheLimitAreDisconnected) {
    std::vector<std::unique_ptr<ExecutorClient>> clients;
    for (int i = 0; i < 8; ++i) {
        clients.push_back(std::make_unique<ExecutorClient>(socket_));
        clients.back()->hello();
    }
    ExecutorClient one_more(socket_);
    EXPECT_TRUE(one_more.isClosed());
    EXPECT_TRUE(clients[0]->ask(getStatus()).has_status());
    clients.pop_back();
    EXPECT_TRUE(eventually([this] {
        ExecutorClient again(socket_);
        Request hello;
        hello.mutable_hello();
        again.send(hello);
        return again.receive().has_value();
    }));
}

TEST_F(ServerTest, ChangeIsAnsweredWithProgressAndOutcome) {
    ExecutorClient client(socket_);
    client.hello();
    const std::uint64_t id = client.send(load("Recorder", "A"));
    std::vector<std::string> progress;
    for (;;) {
        const auto response = client.receive();
        ASSERT_TRUE(response.has_value());
        if (response->id() != id) continue;
        if (response->kind_case() != Response::kProgress) {
            ASSERT_TRUE(response->has_change()) << response->error().message();
            EXPECT_EQ(response->change().component(), "/A");
            break;
        }
        progress.push_back(response->progress());
    }
    EXPECT_EQ(progress,
              (std::vector<std::string>{"loading /A", "configuring /A", "adopting the change"}));
}

TEST_F(ServerTest, AnswersAndEventsHaveTheNumberOfTheState) {
    ExecutorClient client(socket_);
    client.hello();
    const Response begun = client.ask(start());
    EXPECT_EQ(begun.state(), rtcf::v1::RUNNER_STATE_RUNNING);
    Request stop;
    stop.mutable_stop();
    const Response stopped = client.ask(stop);
    EXPECT_EQ(stopped.state(), rtcf::v1::RUNNER_STATE_STOPPED);
    EXPECT_GT(stopped.state_number(), begun.state_number());
    const Response status = client.ask(getStatus());
    EXPECT_EQ(status.state_number(), stopped.state_number());
    EXPECT_EQ(status.state(), stopped.state());
}

// A start that arrives before a stop cannot start the loop after it.
TEST_F(ServerTest, StopCancelsAStartWhoseHooksRun) {
    ExecutorClient client(socket_);
    client.hello();
    Request slow = load("Blocker", "B");
    rtcf::v1::ParameterSetting& blocks =
        *slow.mutable_load()->mutable_component()->add_parameters();
    blocks.set_name("blocks");
    blocks.mutable_value()->set_string_value("start");
    ASSERT_TRUE(client.ask(slow).has_change());
    journal().gate_open = false;
    const std::uint64_t starting = client.send(start());
    ASSERT_TRUE(eventually([] { return journal().count("/B start") == 1; }));
    Request stop;
    stop.mutable_stop();
    const std::uint64_t stopping = client.send(stop);
    (void)client.ask(getStatus());  // so the request has been read
    journal().gate_open = true;
    EXPECT_TRUE(client.answerTo(starting).has_error());
    EXPECT_TRUE(client.answerTo(stopping).has_change());
    EXPECT_EQ(client.ask(getStatus()).status().state(), rtcf::v1::RUNNER_STATE_STOPPED);
    EXPECT_EQ(journal().count("/B update"), 0U);
}

TEST_F(ServerTest, ErrorHasItsCodeAndText) {
    ExecutorClient client(socket_);
    client.hello();
    const Response response = client.ask(unload("X"));
    EXPECT_EQ(response.error().code(), executor::v1::Error::CODE_NOT_FOUND);
    EXPECT_EQ(response.error().message(), "no component /X in this runner; loaded: none");
}

// 2000 characters in an expression or a name once overflowed the graph thread's stack.
TEST_F(ServerTest, TooLongNamesAndExpressionsGetAShortError) {
    ExecutorClient client(socket_);
    client.hello();
    const std::string long_name(2000, 'a');
    Request remapped = load("Recorder", "B");
    auto& remap = *remapped.mutable_load()->mutable_component()->add_remaps();
    remap.set_source("in");
    remap.set_target(long_name);
    Request ignoring = load("Recorder", "B");
    ignoring.mutable_load()->mutable_component()->set_ignore(long_name);
    Request whitelist;
    whitelist.mutable_configure()->mutable_ros()->set_whitelist(long_name);
    // Two names whose combined length exceeds the limit.
    Request mapped = load("Recorder", "B");
    mapped.mutable_load()->mutable_component()->set_ns(long_name.substr(0, 252));
    for (const Request& request :
         {load("Recorder", long_name), remapped, ignoring, whitelist, mapped}) {
        const Response response = client.ask(request);
        ASSERT_TRUE(response.has_error()) << request.ShortDebugString().substr(0, 200);
        EXPECT_EQ(response.error().code(), executor::v1::Error::CODE_INVALID_ARGUMENT);
        EXPECT_NE(response.error().message().find(" characters: at most "), std::string::npos)
            << response.error().message();
        EXPECT_LT(response.error().message().size(), 300U);
    }
    EXPECT_TRUE(client.ask(load("Recorder", "B")).has_change());
}

TEST_F(ServerTest, QueriesAreAnsweredWhileAHookBlocks) {
    ExecutorClient client(socket_);
    client.hello();
    ASSERT_TRUE(client.ask(load("Recorder", "A")).has_change());
    journal().gate_open = false;
    Request blocking = load("Blocker", "B");
    auto& remap = *blocking.mutable_load()->mutable_component()->add_remaps();
    remap.set_source("out");
    remap.set_target("B_out");
    const std::uint64_t loading = client.send(blocking);
    ASSERT_TRUE(eventually([] { return journal().count("/B configure") == 1; }));
    Request list;
    list.mutable_list_components();
    EXPECT_EQ(client.ask(list).components().components_size(), 1);
    EXPECT_TRUE(client.ask(getStatus()).has_status());
    Request info;
    info.mutable_get_component()->set_component("A");
    const Response component = client.ask(info);
    EXPECT_EQ(component.component().full_name(), "/A")
        << "immediately, without values of its ports";
    journal().gate_open = true;
    EXPECT_TRUE(client.answerTo(loading).has_change());
}

TEST_F(ServerTest, StopEndsTheLoopWhileAHookBlocks) {
    ExecutorClient client(socket_);
    client.hello();
    ASSERT_TRUE(client.ask(load("Ticker", "T")).has_change());
    ASSERT_TRUE(client.ask(start()).has_change());
    journal().gate_open = false;
    const std::uint64_t loading = client.send(load("Blocker", "B"));
    ASSERT_TRUE(eventually([] { return journal().count("/B configure") == 1; }));
    Request stop;
    stop.mutable_stop();
    const std::uint64_t stopping = client.send(stop);
    EXPECT_TRUE(eventually([this] { return !runner_.loop().running(); }));
    journal().gate_open = true;
    (void)loading;
    EXPECT_TRUE(client.answerTo(stopping).has_change());
}

TEST_F(ServerTest, EachHookOfTheGraphThreadIsNamed) {
    ExecutorClient client(socket_);
    client.hello();
    const auto activity = [this] { return runner_.recorder().runningHook().name(); };
    Request set;
    set.mutable_set_parameters()->set_component("B");
    rtcf::v1::ParameterSetting& gain = *set.mutable_set_parameters()->add_parameters();
    gain.set_name("gain");
    gain.mutable_value()->set_double_value(2);
    Request stop;
    stop.mutable_stop();
    for (const std::string hook :
         {"configure", "start", "prepare", "stop", "cleanup", "destructor"}) {
        const std::vector<std::pair<std::string, Request>> requests = {
            {"configure", blocker(hook)},
            {"start", start()},
            {"prepare", set},
            {"stop", stop},
            {hook == "destructor" ? hook : "cleanup", unload("B")}};
        for (const auto& [name, request] : requests) {
            journal().gate_open = name != hook;
            const std::uint64_t sent = client.send(request);
            if (name == hook) {
                EXPECT_TRUE(eventually([&] { return activity() == "/B." + hook; })) << activity();
            }
            journal().gate_open = true;
            EXPECT_TRUE(client.answerTo(sent).has_change()) << hook << ": " << name;
            EXPECT_TRUE(eventually([&] { return activity().empty(); })) << activity();
        }
    }
}

TEST_F(ServerTest, AbandonedChangeIsNotMadeLater) {
    ExecutorClient client(socket_);
    client.hello();
    ASSERT_TRUE(client.ask(hookTimeout(0.2)).has_status());
    journal().gate_open = false;
    const std::uint64_t hanging = client.send(load("Blocker", "B"));
    const std::uint64_t queued = client.send(load("Recorder", "C"));
    const Response first = client.answerTo(hanging);
    EXPECT_EQ(first.error().code(), executor::v1::Error::CODE_UNAVAILABLE);
    EXPECT_EQ(first.error().reason(), rtcf::v1::REASON_HOOK_STUCK);
    EXPECT_EQ(first.error().message(),
              "runner rt_runner is stuck in /B.configure() for 0 s: `rtcfctl runner restart "
              "rt_runner` ends this hook and the loop, and loads the saved graph again; `rtcfctl "
              "-r rt_runner unload --force /B` also removes /B from it");
    EXPECT_TRUE(client.answerTo(queued).has_error());
    const rtcf::v1::RunnerStatus status = client.ask(getStatus()).status();
    EXPECT_EQ(status.state(), rtcf::v1::RUNNER_STATE_STUCK);
    EXPECT_EQ(status.stuck().component(), "/B");
    EXPECT_EQ(status.stuck().hook(), "configure");
    EXPECT_FALSE(status.stuck().in_graph());
    EXPECT_TRUE(client.ask(load("Recorder", "D")).has_error()) << "only a stop is accepted now";
    journal().gate_open = true;
    ASSERT_TRUE(eventually([] { return journal().count("/B cleanup") == 1; }));
    ASSERT_TRUE(eventually([&] { return client.ask(load("Recorder", "E")).has_change(); }))
        << "once the hook has returned";
    Request list;
    list.mutable_list_components();
    const Response response = client.ask(list);
    ASSERT_EQ(response.components().components_size(), 1);
    EXPECT_EQ(response.components().components(0).full_name(), "/E");
    EXPECT_EQ(journal().count("/C configure"), 0U);
}

TEST_F(ServerTest, UnloadSucceedsAlthoughTheCleanupDoesNotReturn) {
    ExecutorClient client(socket_);
    client.hello();
    ASSERT_TRUE(client.ask(hookTimeout(0.2)).has_status());
    ASSERT_TRUE(client.ask(blocker("cleanup")).has_change());
    journal().gate_open = false;
    const Response unloaded = client.ask(unload("B"));
    ASSERT_TRUE(unloaded.has_change()) << unloaded.error().message();
    EXPECT_EQ(unloaded.change().component(), "/B");
    ASSERT_EQ(unloaded.change().notes_size(), 1);
    EXPECT_NE(unloaded.change().notes(0).find("stuck in /B.cleanup()"), std::string::npos);
    EXPECT_FALSE(client.ask(getStatus()).status().stuck().in_graph());
    EXPECT_TRUE(client.ask(load("Recorder", "C")).has_error());
}

TEST_F(ServerTest, StopOfALoopIsAnsweredAtOnceIfAHookIsStuck) {
    ExecutorClient client(socket_);
    client.hello();
    ASSERT_TRUE(client.ask(hookTimeout(0.2)).has_status());
    ASSERT_TRUE(client.ask(load("Ticker", "T")).has_change());
    ASSERT_TRUE(client.ask(start()).has_change());
    journal().gate_open = false;
    ASSERT_TRUE(client.ask(load("Blocker", "B")).has_error());
    // Until the test ends, no hook can be called, and no timeout passes.
    ASSERT_TRUE(client.ask(getStatus()).status().has_stuck());
    Request stop;
    stop.mutable_stop();
    const Response stopped = client.ask(stop);
    EXPECT_EQ(stopped.error().reason(), rtcf::v1::REASON_HOOK_STUCK);
    EXPECT_EQ(stopped.error().message().find("the loop has ended, but runner rt_runner is stuck"),
              0U);
    EXPECT_FALSE(runner_.loop().running());
}

TEST_F(ServerTest, EventGoesToAllDaemons) {
    ExecutorClient first(socket_);
    ExecutorClient second(socket_);
    first.hello();
    second.hello();
    Request failing = load("Recorder", "A");
    auto& parameter = *failing.mutable_load()->mutable_component()->add_parameters();
    parameter.set_name("throws_at");
    parameter.mutable_value()->set_int_value(5);
    ASSERT_TRUE(first.ask(failing).has_change());
    first.send(start());
    for (ExecutorClient* client : {&first, &second}) {
        for (;;) {
            const auto response = client->receive();
            ASSERT_TRUE(response.has_value());
            if (!response->has_event() ||
                response->event().kind() != executor::v1::Event::KIND_LOOP_ENDED)
                continue;
            EXPECT_EQ(response->id(), 0U);
            EXPECT_EQ(response->event().component(), "/A");
            break;
        }
    }
}

TEST_F(ServerTest, LogRecordsWaitForADaemon) {
    log_.write(LogLevel::Info, "/A", "before anybody came");
    ExecutorClient client(socket_);
    client.hello();
    for (;;) {
        const auto response = client.receive();
        ASSERT_TRUE(response.has_value());
        if (!response->has_log()) continue;
        EXPECT_EQ(response->log().message(), "before anybody came");
        break;
    }
}

TEST_F(ServerTest, TextsThatAreNotUtf8ArriveWithReplacements) {
    ExecutorClient client(socket_);
    client.hello();
    log_.write(LogLevel::Info, "/A", "Stromst\xE4rke");
    server_.publish(executor::RunnerEvent{executor::RunnerEvent::Kind::ComponentFailed,
                                          "broken: \xFF", "/A", 1});
    const auto next = [&client] {
        const auto response = client.receive();
        return response.has_value() ? *response : Response();
    };
    EXPECT_EQ(next().log().message(), "Stromst\uFFFDrke");
    EXPECT_EQ(next().event().message(), "broken: \uFFFD");
    EXPECT_TRUE(client.ask(getStatus()).has_status());
}

TEST_F(ServerTest, StatisticsRestartWithEachStart) {
    ExecutorClient client(socket_);
    client.hello();
    ASSERT_TRUE(client.ask(load("Ticker", "T")).has_change());
    Request stop;
    stop.mutable_stop();
    Request statistics;
    statistics.mutable_get_statistics();
    const auto iterations = [this] { return runner_.loop().statistics().iteration.load(); };
    for (int i = 0; i < 2; ++i) {
        ASSERT_TRUE(client.ask(start()).has_change());
        ASSERT_TRUE(eventually([&] { return iterations() > 200; }));
        ASSERT_TRUE(client.ask(stop).has_change());
        const rtcf::v1::RunnerStatistics result = client.ask(statistics).statistics();
        EXPECT_LE(result.iterations(), iterations());
        EXPECT_GT(result.iterations(), 100U);
        EXPECT_EQ(result.components(0).duration().count(), result.iterations());
    }
}

TEST_F(ServerTest, StatisticsCountFromTheReset) {
    ExecutorClient client(socket_);
    client.hello();
    ASSERT_TRUE(client.ask(load("Ticker", "T")).has_change());
    Request step;
    step.mutable_step()->set_cycles(1000);
    ASSERT_TRUE(client.ask(step).has_change());
    Request reset;
    reset.mutable_reset_statistics();
    ASSERT_TRUE(client.ask(reset).has_done());
    step.mutable_step()->set_cycles(10);
    ASSERT_TRUE(client.ask(step).has_change());
    Request statistics;
    statistics.mutable_get_statistics();
    const Response response = client.ask(statistics);
    EXPECT_EQ(response.statistics().iterations(), 10U);
    EXPECT_EQ(response.statistics().components(0).duration().count(), 10U);
    EXPECT_EQ(client.ask(getStatus()).status().iteration(), 1010U);
}

// Its cycles follow each other without a pause, so no read matches one cycle by chance.
TEST_F(ServerTest, ResetOfALateLoopIsOneInstant) {
    ExecutorClient client(socket_);
    client.hello();
    Request spinner = load("Spinner", "S");
    for (const auto& [name, value] : {std::pair("busy_us", 300), {"busy_cycles", 1'000'000'000}}) {
        auto& parameter = *spinner.mutable_load()->mutable_component()->add_parameters();
        parameter.set_name(name);
        parameter.mutable_value()->set_int_value(value);
    }
    ASSERT_TRUE(client.ask(spinner).has_change());
    for (int i = 0; i < 20; ++i) {
        const std::string name = "T" + std::to_string(i);
        Request ticker = load("Ticker", name);
        auto& remap = *ticker.mutable_load()->mutable_component()->add_remaps();
        remap.set_source("out");
        remap.set_target(name);
        ASSERT_TRUE(client.ask(ticker).has_change());
    }
    Request reset;
    reset.mutable_reset_statistics();
    Request statistics;
    statistics.mutable_get_statistics();
    Request stop;
    stop.mutable_stop();
    const auto total = [this] { return runner_.loop().statistics().overruns.value(); };
    for (const auto policy : {rtcf::v1::OVERRUN_POLICY_CATCH_UP, rtcf::v1::OVERRUN_POLICY_SKIP}) {
        Request configure;
        configure.mutable_configure()->set_frequency_hz(10000.0);
        configure.mutable_configure()->set_overrun(policy);
        ASSERT_TRUE(client.ask(configure).has_status());
        ASSERT_TRUE(client.ask(start()).has_change());
        for (int i = 0; i < 10; ++i) {
            const std::uint64_t before = total();
            ASSERT_TRUE(eventually([&] { return total() > before; }));
            ASSERT_TRUE(client.ask(reset).has_done());
            // A negative difference would wrap to a large number.
            const std::uint64_t of_status = client.ask(getStatus()).status().overruns();
            ASSERT_LE(of_status, total());
            const std::uint64_t of_statistics = client.ask(statistics).statistics().overruns();
            ASSERT_LE(of_statistics, total());
        }
        const std::uint64_t before = total();
        ASSERT_TRUE(eventually([&] { return total() > before + 20; }));
        ASSERT_TRUE(client.ask(stop).has_change());
        const rtcf::v1::RunnerStatus status = client.ask(getStatus()).status();
        const rtcf::v1::RunnerStatistics result = client.ask(statistics).statistics();
        EXPECT_GT(result.overruns(), 20U);
        EXPECT_LE(result.overruns(), result.iterations());
        EXPECT_EQ(status.overruns(), result.overruns());
        EXPECT_EQ(status.missed(), result.missed());
        EXPECT_EQ(result.latency().count(), result.iterations());
        std::uint64_t causes = result.late_wake_ups() + result.exchange_overruns() +
                               result.frame_overruns() + result.catching_up();
        for (const auto& component : result.components()) {
            EXPECT_EQ(component.duration().count(), result.iterations()) << component.component();
            causes += component.overruns();
        }
        EXPECT_EQ(causes, result.overruns());
    }
}

TEST_F(ServerTest, ResetsTheStatisticsWhileAComponentDoesNotReturn) {
    ExecutorClient client(socket_);
    client.hello();
    Request configure;
    configure.mutable_configure()->set_stall_timeout_ms(0);
    ASSERT_TRUE(client.ask(configure).has_status());
    ASSERT_TRUE(client.ask(load("Gated", "G")).has_change());
    ASSERT_TRUE(client.ask(start()).has_change());
    Request reset;
    reset.mutable_reset_statistics();
    Request statistics;
    statistics.mutable_get_statistics();
    const auto iterations = [&] { return client.ask(statistics).statistics().iterations(); };
    ASSERT_TRUE(eventually([&] { return iterations() > 0; }));

    const std::size_t before = journal().count("/G waits");
    journal().gate_open = false;
    ASSERT_TRUE(eventually([&] { return journal().count("/G waits") > before; }));
    ASSERT_TRUE(client.ask(reset).has_done());
    EXPECT_EQ(iterations(), 0U);
    journal().gate_open = true;
    EXPECT_TRUE(eventually([&] { return iterations() > 0; }));
}

// A thread of the ROS node that makes a call and waits.
class Asking {
   public:
    Asking(executor::Server& server, const executor::OutsideCall& call)
        : answer_(std::async(std::launch::async,
                             [this, &server, call] { return server.ask(call, cancel_); })) {}
    executor::OutsideAnswer get() { return answer_.get(); }
    void cancel() { cancel_ = true; }

   private:
    std::atomic<bool> cancel_{false};
    std::future<executor::OutsideAnswer> answer_;
};

// The next call that a daemon receives.
executor::v1::ServiceCall nextCall(ExecutorClient& client) {
    for (;;) {
        const auto response = client.receive();
        if (!response || response->has_service_call())
            return response ? response->service_call() : executor::v1::ServiceCall();
    }
}

TEST_F(ServerTest, CallFromOutsideIsAnsweredByTheLatestDaemon) {
    ExecutorClient first(socket_);
    first.hello();
    ExecutorClient client(socket_);
    client.hello();
    executor::OutsideCall load;
    load.kind = executor::OutsideCall::Kind::Load;
    load.component.type = "Ticker";
    load.component.remaps = {{"out", "there"}};
    load.component.breaks.first = true;
    Asking asking(server_, load);
    const executor::v1::ServiceCall call = nextCall(client);
    EXPECT_EQ(call.load().type(), "Ticker");
    EXPECT_EQ(call.load().remaps(0).target(), "there");
    EXPECT_TRUE(call.load().first());
    Request answer;
    answer.mutable_service_answer()->set_call(call.call());
    answer.mutable_service_answer()->set_success(true);
    answer.mutable_service_answer()->set_message("as you like it");
    EXPECT_TRUE(client.ask(answer).has_done());
    const executor::OutsideAnswer got = asking.get();
    EXPECT_TRUE(got.success);
    EXPECT_EQ(got.message, "as you like it");
    // The other daemon did not receive it.
    first.send(getStatus());
    const auto next = first.receive();
    ASSERT_TRUE(next.has_value());
    EXPECT_TRUE(next->has_status());
}

TEST_F(ServerTest, CallFromOutsideWithoutADaemonFailsImmediately) {
    Asking asking(server_, {});
    EXPECT_EQ(asking.get().message, "no rtcfd is connected to this executor: is it running?");
}

TEST_F(ServerTest, CallFromOutsideFailsWithItsDaemon) {
    auto client = std::make_unique<ExecutorClient>(socket_);
    client->hello();
    Asking asking(server_, {});
    EXPECT_TRUE(nextCall(*client).has_start());
    client.reset();
    const executor::OutsideAnswer got = asking.get();
    EXPECT_FALSE(got.success);
    EXPECT_EQ(got.message, "rtcfd has disconnected; it may have carried out the request");
}

TEST_F(ServerTest, CallFromOutsideCanBeAbandoned) {
    ExecutorClient client(socket_);
    client.hello();
    Asking asking(server_, {});
    const std::uint64_t number = nextCall(client).call();
    asking.cancel();
    EXPECT_EQ(asking.get().message, "the executor is ending");
    // A late answer is no error.
    Request answer;
    answer.mutable_service_answer()->set_call(number);
    EXPECT_TRUE(client.ask(answer).has_done());
}

}  // namespace
}  // namespace rtcf::test
