// rtcf-executor: the process that runs one loop. Started by rtcfd; see
// proto/rtcf/executor/v1/executor.proto for its socket. Only this file includes both executor and
// ROS, and connects them.
#include <fmt/format.h>
#include <getopt.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "access/rights.hpp"
#include "check/check.hpp"
#include "check/check_settings.hpp"
#include "check/describe.hpp"
#include "common/c_locale.hpp"
#include "faults/crash_handler.hpp"
#include "faults/flight_recorder.hpp"
#include "logging/log.hpp"
#include "names/names.hpp"
#include "realtime/cycle_counter.hpp"
#include "realtime/realtime.hpp"
#include "ros/logging/rosout.hpp"
#include "ros/ros_node.hpp"
#include "rtcf/version.hpp"
#include "runner/runner.hpp"
#include "server/direct_stop.hpp"
#include "server/server.hpp"

namespace {

using namespace rtcf::executor;
using rtcf::LogLevel;

struct Options {
    std::string runner;
    std::string daemon;
    std::string socket;
    std::string stop_socket;
    std::string resume_mark;
    std::string cpu_claims;
    std::string describe;
    std::string package;
    std::vector<uid_t> trusted;
    CheckRequest check;
    bool check_settings = false;
};

constexpr const char* kUsage =
    "usage: rtcf-executor --runner NAME --socket PATH [--daemon NAME] [--stop-socket PATH]\n"
    "                     [--resume-mark FILE] [--cpu-claims FOLDER]\n"
    "       rtcf-executor --describe LIBRARY --package PACKAGE [--trust UID]...\n"
    "       rtcf-executor --check LIBRARY --package PACKAGE --type TYPE [--cycles N] [--param "
    "NAME:=VALUE]...\n"
    "       rtcf-executor --check-settings <SETTINGS\n"
    "       rtcf-executor --version\n"
    "It is started by rtcfd(8); see rtcf-executor(8).\n";

constexpr int kUsageStatus = 2;

// @return exit status, or -1 to continue
int parse(int argc, char** argv, Options& options) {
    enum Option {
        kRunner = 1,
        kSocket,
        kStopSocket,
        kResumeMark,
        kCpuClaims,
        kDaemon,
        kDescribe,
        kPackage,
        kCheck,
        kCheckSettings,
        kType,
        kCycles,
        kParam,
        kTrust,
        kVersion,
        kHelp
    };
    const option known[] = {{"runner", required_argument, nullptr, kRunner},
                            {"socket", required_argument, nullptr, kSocket},
                            {"stop-socket", required_argument, nullptr, kStopSocket},
                            {"resume-mark", required_argument, nullptr, kResumeMark},
                            {"cpu-claims", required_argument, nullptr, kCpuClaims},
                            {"daemon", required_argument, nullptr, kDaemon},
                            {"describe", required_argument, nullptr, kDescribe},
                            {"package", required_argument, nullptr, kPackage},
                            {"check", required_argument, nullptr, kCheck},
                            {"check-settings", no_argument, nullptr, kCheckSettings},
                            {"type", required_argument, nullptr, kType},
                            {"cycles", required_argument, nullptr, kCycles},
                            {"param", required_argument, nullptr, kParam},
                            {"trust", required_argument, nullptr, kTrust},
                            {"version", no_argument, nullptr, kVersion},
                            {"help", no_argument, nullptr, kHelp},
                            {nullptr, 0, nullptr, 0}};
    for (int chosen = getopt_long(argc, argv, "", known, nullptr); chosen != -1;
         chosen = getopt_long(argc, argv, "", known, nullptr)) {
        switch (chosen) {
            case kRunner:
                options.runner = optarg;
                break;
            case kSocket:
                options.socket = optarg;
                break;
            case kStopSocket:
                options.stop_socket = optarg;
                break;
            case kResumeMark:
                options.resume_mark = optarg;
                break;
            case kCpuClaims:
                options.cpu_claims = optarg;
                break;
            case kDaemon:
                options.daemon = optarg;
                break;
            case kDescribe:
                options.describe = optarg;
                break;
            case kPackage:
                options.package = optarg;
                break;
            case kCheck:
                options.check.library = optarg;
                break;
            case kCheckSettings:
                options.check_settings = true;
                break;
            case kType:
                options.check.type = optarg;
                break;
            case kCycles:
                options.check.cycles = std::strtoull(optarg, nullptr, 10);
                break;
            case kParam:
                options.check.parameters.emplace_back(optarg);
                break;
            case kTrust:
                options.trusted.push_back(static_cast<uid_t>(std::strtoul(optarg, nullptr, 10)));
                break;
            case kVersion:
                std::puts("rtcf-executor " RTCF_VERSION);
                return 0;
            case kHelp:
                std::fputs(kUsage, stdout);
                return 0;
            default:
                std::fputs(kUsage, stderr);
                return kUsageStatus;
        }
    }
    options.check.package = options.package;
    const bool describes = !options.describe.empty() && !options.package.empty();
    const bool checks =
        !options.check.library.empty() && !options.package.empty() && !options.check.type.empty();
    const bool runs = isBaseName(options.runner) && !options.socket.empty();
    const int tasks =
        (describes ? 1 : 0) + (checks ? 1 : 0) + (runs ? 1 : 0) + (options.check_settings ? 1 : 0);
    if (optind == argc && tasks == 1) return -1;
    std::fputs(kUsage, stderr);
    return kUsageStatus;
}

// Thread that formats log records until the executor ends.
class LogDrain {
   public:
    explicit LogDrain(Log& log)
        : thread_([this, &log] {
              pthread_setname_np(pthread_self(), "rtcf-log");
              while (!ending_.load(std::memory_order_acquire)) {
                  log.drain();
                  std::this_thread::sleep_for(std::chrono::milliseconds(10));
              }
          }) {}
    ~LogDrain() {
        ending_.store(true, std::memory_order_release);
        thread_.join();
    }

   private:
    std::atomic<bool> ending_{false};
    std::thread thread_;
};

LogLevel levelOf(RunnerEvent::Kind kind) {
    switch (kind) {
        case RunnerEvent::Kind::LoopEnded:
            return LogLevel::Error;
        case RunnerEvent::Kind::Degraded:
        case RunnerEvent::Kind::ComponentFailed:
        case RunnerEvent::Kind::Overruns:
            return LogLevel::Warn;
        case RunnerEvent::Kind::Clock:
        case RunnerEvent::Kind::ParametersChanged:
        case RunnerEvent::Kind::Ros:
            break;
    }
    return LogLevel::Info;
}

int run(const Options& options) {
    prepareProcess();
    // Blocks signals first, so that all later threads inherit the mask.
    Server server(options.socket);
    Access access;
    rtcf::ros1::Rosout rosout;
    Log log([&](LogEntry&& entry) {
        server.publish(entry);
        rosout.publish(entry);
    });
    const auto publish = [&](const RunnerEvent& event) {
        server.publish(event);
        if (event.message.empty()) return;
        LogEntry entry;
        entry.level = levelOf(event.kind);
        entry.time_ns = realtimeNow();
        entry.iteration = event.iteration;
        entry.component = event.component;
        entry.message = event.message;
        rosout.publish(entry);
    };
    {
        FlightRecorder recorder;
        installCrashHandler(recorder);
        const CrashContext crash_context(ThreadRole::Other);
        const LogDrain drain(log);
        Runner runner(options.runner, log, publish,
                      std::make_unique<rtcf::ros1::RosNode>(
                          options.daemon, options.runner, access,
                          [&](const std::string& message) {
                              publish(RunnerEvent{RunnerEvent::Kind::Ros, message, {}, 0});
                          },
                          log, rosout,
                          [&server](const OutsideCall& call, const std::atomic<bool>& cancel) {
                              return server.ask(call, cancel);
                          }),
                      recorder, options.cpu_claims);
        // Constructed after the runner, so that it can stop the runner until the end.
        DirectStop direct_stop(options.stop_socket, options.resume_mark, access);
        direct_stop.serve({[&] {
                               runner.requestStop();
                               server.wakeUp();
                               runner.post([&runner] {
                                   try {
                                       runner.stop([](const std::string&) {});
                                   } catch (const std::exception&) {
                                       // The loop has not ended yet; Runner::tick() notices its
                                       // end.
                                   }
                               });
                           },
                           [&] { return runner.loop().running(); }});
        server.serve(runner, log, access, direct_stop);
    }
    log.end();
    server.deliver();
    return 0;
}

}  // namespace

int main(int argc, char** argv) {
    useCLocale();
    Options options;
    if (const int status = parse(argc, argv, options); status >= 0) return status;
    try {
        if (!options.describe.empty())
            return describeLibrary(options.describe, options.package, options.trusted);
        if (!options.check.library.empty()) return checkComponent(options.check);
        if (options.check_settings) return checkSettings();
        return run(options);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "rtcf-executor: %s\n", error.what());
        return 1;
    }
}
