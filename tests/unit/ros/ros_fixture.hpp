/// @file
/// A private ROS for each test: a master on a free port, files in a temporary
/// folder, peers in separate processes; and the executor's side of the node:
/// taps and injectors of std_msgs/Float64.
#pragma once

#include <gtest/gtest.h>
#include <std_msgs/Float64.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "child_process.hpp"
#include "exchange/injector.hpp"
#include "frames/frame_ring.hpp"
#include "loop/frame_tap.hpp"
#include "ros/logging/rosout.hpp"
#include "ros/ros_node.hpp"

using namespace std::chrono_literals;

/// An output of the loop: write() acts like a cycle.
class Source {
   public:
    explicit Source(const std::string& topic)
        : slot_(std::make_shared<rtcf::Slot<std_msgs::Float64>>()),
          ring_(std::make_shared<rtcf::executor::FrameRing>(
              std::vector<rtcf::executor::FrameRing::Source>{
                  {slot_.get(), sizeof *slot_, sizeof(rtcf::SlotHeader)}},
              0, 4096, rtcf::executor::CycleCounter())),
          tap_(std::make_shared<rtcf::executor::FrameTap>(
              topic, rtcf::typeInfo<std_msgs::Float64>(), slot_)) {
        tap_->follow(ring_, 0);
    }

    std::shared_ptr<rtcf::executor::Tap> tap() const { return tap_; }
    /// @param stamp_ns stamp of the cycle
    void write(double value, std::int64_t stamp_ns = 0) {
        slot_->value.data = value;
        ++slot_->stamp;
        ring_->begin({0, stamp_ns, 0, 0, 0});
        ring_->take();
        ring_->commit(0);
    }

   private:
    std::shared_ptr<rtcf::Slot<std_msgs::Float64>> slot_;
    std::shared_ptr<rtcf::executor::FrameRing> ring_;
    std::shared_ptr<rtcf::executor::FrameTap> tap_;
};

/// An input of the loop: value() is the value read by a cycle.
class Sink {
   public:
    explicit Sink(const std::string& topic)
        : injector_(std::make_shared<rtcf::executor::Injector>(
              topic, rtcf::typeInfo<std_msgs::Float64>())) {}

    const std::shared_ptr<rtcf::executor::Injector>& injector() const { return injector_; }
    double value() {
        injector_->adopt({});
        return static_cast<const rtcf::Slot<std_msgs::Float64>*>(injector_->front())->value.data;
    }

   private:
    std::shared_ptr<rtcf::executor::Injector> injector_;
};

class RosFixture : public ::testing::Test {
   protected:
    RosFixture();
    ~RosFixture() override;

    /// Starts a master, always on the same port, and waits until it answers.
    void startMaster();
    /// Starts a master that answers until a topic is registered.
    void startDeafMaster();
    /// Starts a real master behind a relay that delays each call.
    void startSlowMaster(std::chrono::milliseconds each);
    void stopMaster() {
        master_.reset();
        real_master_.reset();
    }
    ChildProcess& master() { return *master_; }
    std::string masterUri() const { return "http://127.0.0.1:" + std::to_string(port_); }

    /// A rospy node that prints the values of a topic, one per line, after the stamp if any.
    std::unique_ptr<ChildProcess> listen(const std::string& topic,
                                         const std::string& type = "std_msgs/Float64");
    /// A rospy node that publishes one latched value and stays.
    std::unique_ptr<ChildProcess> send(const std::string& topic, double value);
    /// A rospy node that publishes 1, 2, 3...
    std::unique_ptr<ChildProcess> count(const std::string& topic);
    /// A rospy node that prints `name|message` of all reported diagnostics.
    std::unique_ptr<ChildProcess> health();
    /// A rospy node with a given name.
    std::unique_ptr<ChildProcess> node(const std::string& name);
    /// Runs a command such as `rosnode`. @return its output
    std::string run(const std::vector<std::string>& command);
    /// Has a peer call the node's services like rqt_logger_level. @return "done\n"
    std::string lookAtLoggers();

    /// Starts the node with this master.
    void startNode();
    void stopNode() { node_.reset(); }
    /// A node that the test starts and ends itself.
    std::unique_ptr<rtcf::ros1::RosNode> makeNode();
    rtcf::executor::Log& log() { return log_; }
    /// Ends the node. @return false if it took as long as a timeout of the master
    bool nodeEnds();
    rtcf::ros1::RosNode& rosNode() { return *node_; }
    void serve(const std::vector<Source*>& outputs, const std::vector<Sink*>& inputs);

    /// Polls `condition`. @return false at the deadline
    static bool eventually(const std::function<bool()>& condition,
                           std::chrono::milliseconds timeout = 30s);
    /// Writes increasing values, 1 ms apart, until the listener prints one. @return its line, ""
    /// if none
    static std::string flow(Source& source, ChildProcess& listener,
                            std::chrono::milliseconds timeout = 30s);
    bool reported(const std::string& part) const;

   private:
    std::map<std::string, std::string> environment() const;
    void startMaster(const std::vector<std::string>& command);

    std::filesystem::path folder_;
    int port_ = 0;
    std::unique_ptr<ChildProcess> master_;
    std::unique_ptr<ChildProcess> real_master_;  // behind a slow one
    mutable std::mutex mutex_;                   // reports_
    std::vector<std::string> reports_;
    rtcf::executor::Access access_;
    rtcf::ros1::Rosout rosout_;
    rtcf::executor::Log log_{[this](rtcf::executor::LogEntry&& entry) { rosout_.publish(entry); }};
    std::unique_ptr<rtcf::ros1::RosNode> node_;
};
