#include "ros_fixture.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <thread>

#include "ros/calls/master_client.hpp"

namespace {

int freePort() {
    const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&address), size), 0);
    getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size);
    close(listener);
    return ntohs(address.sin_port);
}

}  // namespace

RosFixture::RosFixture() : port_(freePort()) {
    std::string folder = (std::filesystem::temp_directory_path() / "rtcf-ros-XXXXXX").string();
    folder_ = mkdtemp(folder.data());
    // roscpp reads its settings from the environment only once.
    for (const auto& [name, value] : environment()) setenv(name.c_str(), value.c_str(), 1);
    unsetenv("ROS_MASTER_URI");
    unsetenv("ROS_NAMESPACE");
}

RosFixture::~RosFixture() {
    node_.reset();
    master_.reset();
    std::filesystem::remove_all(folder_);
}

std::map<std::string, std::string> RosFixture::environment() const {
    return {{"ROS_MASTER_URI", masterUri()}, {"ROS_IP", "127.0.0.1"},
            {"ROS_HOME", folder_ / "home"},  {"ROS_LOG_DIR", folder_ / "log"},
            {"PYTHONPATH", RTCF_PYTHON},     {"PYTHONUNBUFFERED", "1"}};
}

void RosFixture::startMaster() {
    startMaster({"rosmaster", "--core", "-p", std::to_string(port_)});
}

void RosFixture::startDeafMaster() {
    startMaster({"/usr/bin/python3", RTCF_DEAF_MASTER, std::to_string(port_)});
}

void RosFixture::startSlowMaster(std::chrono::milliseconds each) {
    const std::string real = std::to_string(freePort());
    auto environment = this->environment();
    environment["ROS_MASTER_URI"] = "http://127.0.0.1:" + real;
    real_master_ = std::make_unique<ChildProcess>(
        std::vector<std::string>{"rosmaster", "--core", "-p", real}, environment);
    startMaster({"/usr/bin/python3", RTCF_SLOW_MASTER, std::to_string(port_), real,
                 std::to_string(each.count())});
}

void RosFixture::startMaster(const std::vector<std::string>& command) {
    master_ = std::make_unique<ChildProcess>(command, environment());
    ASSERT_TRUE(eventually([this] {
        const std::atomic<bool> never{false};
        // Longer than the delay of any slow master.
        rtcf::ros1::MasterClient client({"127.0.0.1", static_cast<std::uint32_t>(port_)}, 3s,
                                        never);
        XmlRpc::XmlRpcValue arguments;
        arguments[0] = std::string("/test");
        return !client.call("getPid", arguments).silent();
    })) << "the master does not come up";
}

std::unique_ptr<ChildProcess> RosFixture::listen(const std::string& topic,
                                                 const std::string& type) {
    return std::make_unique<ChildProcess>(
        std::vector<std::string>{"/usr/bin/python3", RTCF_PEER, "listen", topic, type},
        environment());
}

std::unique_ptr<ChildProcess> RosFixture::send(const std::string& topic, double value) {
    return std::make_unique<ChildProcess>(
        std::vector<std::string>{"/usr/bin/python3", RTCF_PEER, "send", topic,
                                 std::to_string(value)},
        environment());
}

std::unique_ptr<ChildProcess> RosFixture::count(const std::string& topic) {
    return std::make_unique<ChildProcess>(
        std::vector<std::string>{"/usr/bin/python3", RTCF_PEER, "count", topic}, environment());
}

std::unique_ptr<ChildProcess> RosFixture::health() {
    return std::make_unique<ChildProcess>(
        std::vector<std::string>{"/usr/bin/python3", RTCF_PEER, "health", "/diagnostics"},
        environment());
}

std::unique_ptr<ChildProcess> RosFixture::node(const std::string& name) {
    return std::make_unique<ChildProcess>(
        std::vector<std::string>{"/usr/bin/python3", RTCF_PEER, "node", name}, environment());
}

std::string RosFixture::run(const std::vector<std::string>& command) {
    ChildProcess process(command, environment());
    std::string text;
    while (const auto line = process.line(20s)) text += *line + "\n";
    return text;
}

std::string RosFixture::lookAtLoggers() {
    return run({"/usr/bin/python3", RTCF_PEER, "loggers", node_->status().node});
}

std::unique_ptr<rtcf::ros1::RosNode> RosFixture::makeNode() {
    return std::make_unique<rtcf::ros1::RosNode>(
        "", "rt_runner", access_,
        [this](const std::string& message) {
            const std::lock_guard lock(mutex_);
            reports_.push_back(message);
        },
        log_, rosout_,
        [](const rtcf::executor::OutsideCall&, const std::atomic<bool>&) {
            return rtcf::executor::OutsideAnswer{};
        });
}

void RosFixture::startNode() {
    node_ = makeNode();
    rtcf::executor::BridgeSettings settings;
    settings.master_uri = masterUri();
    settings.peers = rtcf::executor::Right::Admin;
    node_->configure(settings);
}

bool RosFixture::nodeEnds() {
    constexpr auto kHangs = 40s;  // the node's own limit is two on an idle machine
    const auto begin = std::chrono::steady_clock::now();
    stopNode();
    return std::chrono::steady_clock::now() - begin < kHangs;
}

void RosFixture::serve(const std::vector<Source*>& outputs, const std::vector<Sink*>& inputs) {
    auto table = std::make_shared<rtcf::executor::BridgeTable>();
    for (const Source* source : outputs) table->outputs.push_back(source->tap());
    for (const Sink* sink : inputs) table->inputs.push_back(sink->injector());
    node_->setTable(table);
}

bool RosFixture::eventually(const std::function<bool()>& condition,
                            std::chrono::milliseconds timeout) {
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    while (!condition()) {
        if (std::chrono::steady_clock::now() > deadline) return false;
        std::this_thread::sleep_for(5ms);
    }
    return true;
}

std::string RosFixture::flow(Source& source, ChildProcess& listener,
                             std::chrono::milliseconds timeout) {
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    for (double value = 1.0; std::chrono::steady_clock::now() < deadline; value += 1.0) {
        source.write(value);
        const auto line = listener.line(1ms);
        if (line) return *line;
    }
    return "";
}

bool RosFixture::reported(const std::string& part) const {
    const std::lock_guard lock(mutex_);
    for (const auto& report : reports_) {
        if (report.find(part) != std::string::npos) return true;
    }
    return false;
}
