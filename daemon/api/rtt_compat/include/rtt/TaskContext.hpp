/// @file
/// OROCOS' TaskContext by its name, over rtcf::Component: the five hooks, the
/// ports and the state that RTCF 2021's components use.
#pragma once

#include <atomic>
#include <string>
#include <utility>

#include "rtcf/component.hpp"
#include "rtt/Port.hpp"

namespace RTT {

using Seconds = double;

namespace base {

/// The states of a component.
class TaskCore {
   public:
    enum TaskState { Init, PreOperational, FatalError, Exception, Stopped, Running, RunTimeError };

    virtual ~TaskCore() = default;
};

}  // namespace base

/// Ports are added to it; one belongs to each component.
class DataFlowInterface {
   public:
    explicit DataFlowInterface(::rtcf::Component* owner) : owner_(owner) {}

    /// @name In the constructor or in configureHook(); the port's address must not change any more
    /// @throws std::logic_error as PortInterface::addTo() does
    /// @{
    base::PortInterface& addPort(base::PortInterface& port) {
        port.addTo(owner_);
        return port;
    }
    base::PortInterface& addPort(const std::string& name, base::PortInterface& port) {
        port.setName(name);
        return addPort(port);
    }
    /// As addPort(): a component is updated in every cycle, whatever arrives.
    template <typename... Arguments>
    base::PortInterface& addEventPort(Arguments&&... arguments) {
        return addPort(std::forward<Arguments>(arguments)...);
    }
    /// @}

   private:
    ::rtcf::Component* owner_;
};

/// The base class of RTCF 2021's components.
class TaskContext : public ::rtcf::Component, public base::TaskCore {
   public:
    using TaskState = base::TaskCore::TaskState;

    /// @param initial_state for source compatibility: configureHook() is always called
    explicit TaskContext(std::string name, TaskState initial_state = Stopped)
        : given_name_(std::move(name)), ports_(this) {
        (void)initial_state;
    }

    /// @name Hooks, to be overridden; only updateHook() is called in the real-time thread
    /// @{
    virtual bool configureHook() { return true; }
    virtual bool startHook() { return true; }
    virtual void updateHook() {}
    virtual void stopHook() {}
    virtual void cleanupHook() {}
    /// @}

    /// @name Real-time safe
    /// @{
    /// The component's base name, e.g. "example1".
    const std::string& getName() const noexcept { return given_name_; }
    /// This component's nominal period, s.
    Seconds getPeriod() const noexcept RTCF_NONBLOCKING {
        return static_cast<Seconds>(period()) * 1e-9;
    }
    /// True between the end of startHook() and the end of stopHook().
    bool isRunning() const noexcept RTCF_NONBLOCKING { return getTaskState() == Running; }
    bool isConfigured() const noexcept RTCF_NONBLOCKING { return getTaskState() >= Stopped; }
    TaskState getTaskState() const noexcept RTCF_NONBLOCKING {
        return state_.load(std::memory_order_relaxed);
    }
    /// Where the hook that runs just now leads to; the same as getTaskState() outside of hooks.
    TaskState getTargetState() const noexcept RTCF_NONBLOCKING {
        return target_.load(std::memory_order_relaxed);
    }
    /// @}

    DataFlowInterface* ports() noexcept { return &ports_; }
    base::PortInterface& addPort(base::PortInterface& port) { return ports_.addPort(port); }
    base::PortInterface& addPort(const std::string& name, base::PortInterface& port) {
        return ports_.addPort(name, port);
    }

   private:
    bool configure() final {
        return enter(Stopped, [this] { return configureHook(); });
    }
    bool start() final {
        return enter(Running, [this] { return startHook(); });
    }
    void update() final { updateHook(); }
    void stop() final {
        enter(Stopped, [this] { return stopHook(), true; });
    }
    void cleanup() final {
        enter(PreOperational, [this] { return cleanupHook(), true; });
    }

    // The state changes when the hook is over; an exception or a refusal leaves it as it was.
    template <typename Hook>
    bool enter(TaskState next, const Hook& hook) {
        target_.store(next, std::memory_order_relaxed);
        try {
            if (hook()) {
                state_.store(next, std::memory_order_relaxed);
                return true;
            }
        } catch (...) {
            target_.store(getTaskState(), std::memory_order_relaxed);
            throw;
        }
        target_.store(getTaskState(), std::memory_order_relaxed);
        return false;
    }

    std::string given_name_;
    DataFlowInterface ports_;
    // Written by the graph thread, read by all hooks.
    std::atomic<TaskState> state_{PreOperational};
    std::atomic<TaskState> target_{PreOperational};
};

}  // namespace RTT
