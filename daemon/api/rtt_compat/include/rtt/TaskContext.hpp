/// @file
/// OROCOS' TaskContext on top of rtcf::Component: the hooks, ports and states that RTCF 2021's
/// components use.
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "rtcf/component.hpp"
#include "rtcf/log_buffer.hpp"
#include "rtt/Port.hpp"
#include "rtt/Property.hpp"
#include "rtt/Time.hpp"
#include "rtt/current_component.hpp"

namespace RTT {

namespace base {

/// The states of a component.
class TaskCore {
   public:
    enum TaskState { Init, PreOperational, FatalError, Exception, Stopped, Running, RunTimeError };

    virtual ~TaskCore() = default;
};

}  // namespace base

/// The ports of one component.
class DataFlowInterface {
   public:
    using Ports = std::vector<base::PortInterface*>;
    using PortNames = std::vector<std::string>;
    using Callback = std::function<void(base::PortInterface*)>;

    explicit DataFlowInterface(::rtcf::Component* owner) : owner_(owner) {}

    /// @name In the constructor or in configureHook(); not real-time safe
    /// The port's address must not change any more. As in OROCOS, a port replaces another one of
    /// the same name, and has no effect if it was added before.
    /// @throws std::logic_error like PortInterface::addTo() and PortInterface::replace()
    /// @{
    base::PortInterface& addPort(base::PortInterface& port) {
        base::PortInterface* const earlier = getPort(port.getName());
        if (earlier == nullptr) {
            port.addTo(owner_);
            ports_.push_back(&port);
        } else if (earlier != &port) {
            port.replace(*earlier);
            std::replace(ports_.begin(), ports_.end(), earlier, &port);
            dropCallbacks(earlier);
        }
        return port;
    }
    base::PortInterface& addPort(const std::string& name, base::PortInterface& port) {
        rename(port, name);
        return addPort(port);
    }
    /// Like addPort(): the component is updated in every cycle, with or without new data. In cycles
    /// with new data on the port, `callback` is called before updateHook(), in the real-time
    /// thread.
    base::PortInterface& addEventPort(base::PortInterface& port, Callback callback = {}) {
        addPort(port);
        dropCallbacks(&port);
        if (callback) callbacks_.emplace_back(&port, std::move(callback));
        return port;
    }
    base::PortInterface& addEventPort(const std::string& name, base::PortInterface& port,
                                      Callback callback = {}) {
        rename(port, name);
        return addEventPort(port, std::move(callback));
    }
    /// @}

    /// The ports in the order of addPort().
    const Ports& getPorts() const noexcept { return ports_; }
    PortNames getPortNames() const {
        PortNames names;
        for (const base::PortInterface* port : ports_) names.push_back(port->getName());
        return names;
    }
    /// The port of this name; null if there is none.
    base::PortInterface* getPort(const std::string& name) const noexcept {
        const auto found =
            std::find_if(ports_.begin(), ports_.end(),
                         [&](const base::PortInterface* port) { return port->getName() == name; });
        return found == ports_.end() ? nullptr : *found;
    }
    template <typename Port>
    Port* getPortType(const std::string& name) const noexcept {
        return dynamic_cast<Port*>(getPort(name));
    }

    /// Calls the callbacks of ports with new data. In the real-time thread, before updateHook().
    void callBack() {
        for (const auto& [port, callback] : callbacks_) {
            if (port->hasNewData()) callback(port);
        }
    }

   private:
    static void rename(base::PortInterface& port, const std::string& name) {
        if (port.setName(name) || port.getName() == name) return;
        throw std::logic_error("port '" + port.getName() + "' is added again as '" + name +
                               "': a port has one name");
    }
    void dropCallbacks(const base::PortInterface* port) {
        callbacks_.erase(std::remove_if(callbacks_.begin(), callbacks_.end(),
                                        [&](const auto& each) { return each.first == port; }),
                         callbacks_.end());
    }

    ::rtcf::Component* owner_;
    Ports ports_;
    std::vector<std::pair<base::PortInterface*, Callback>> callbacks_;
};

class TaskContext;

/// Result of provides(). A component has one service: itself.
class Service : public Described {
   public:
    explicit Service(TaskContext* owner) noexcept : owner_(owner) {}

    template <typename T>
    Described& addProperty(const std::string& name, T& variable);
    template <typename... Arguments>
    Described& addOperation(const std::string& name, Arguments&&...);
    Service* provides() noexcept { return this; }
    Service* provides(const std::string&) noexcept { return this; }

   private:
    TaskContext* owner_;
};

/// Base class of RTCF 2021's components.
class TaskContext : public ::rtcf::Component, public base::TaskCore {
   public:
    using TaskState = base::TaskCore::TaskState;

    /// @param initial_state ignored: configureHook() is always called
    explicit TaskContext(std::string name, TaskState initial_state = Stopped)
        : given_name_(std::move(name)), ports_(this), service_(this) {
        (void)initial_state;
        // The component's address is only known from here on.
        if (auto* const slot = ::rtcf::rtt_compat::hookSlot(); slot != nullptr)
            slot->component = this;
    }

    /// @name Hooks, to be overridden; only updateHook() and errorHook() are called in the real-time
    /// thread
    /// @{
    virtual bool configureHook() { return true; }
    virtual bool startHook() { return true; }
    virtual void updateHook() {}
    virtual void errorHook() {}  ///< called instead of updateHook() between error() and recover()
    virtual void stopHook() {}
    virtual void cleanupHook() {}
    virtual void exceptionHook() {}  ///< never called; for source compatibility
    /// @}

    /// @name Real-time safe
    /// @{
    /// The component's base name, e.g. "example1".
    const std::string& getName() const noexcept { return given_name_; }
    /// This component's nominal period, s.
    Seconds getPeriod() const noexcept RTCF_NONBLOCKING {
        return static_cast<Seconds>(period()) * 1e-9;
    }
    /// True from the end of startHook() to the end of stopHook().
    bool isRunning() const noexcept RTCF_NONBLOCKING { return getTaskState() >= Running; }
    bool isActive() const noexcept RTCF_NONBLOCKING { return isRunning(); }
    bool isConfigured() const noexcept RTCF_NONBLOCKING { return getTaskState() >= Stopped; }
    bool inRunTimeError() const noexcept RTCF_NONBLOCKING { return getTaskState() == RunTimeError; }
    TaskState getTaskState() const noexcept RTCF_NONBLOCKING {
        return state_.load(std::memory_order_relaxed);
    }
    /// The state after the hook that runs now; outside of hooks, the same as getTaskState().
    TaskState getTargetState() const noexcept RTCF_NONBLOCKING {
        return target_.load(std::memory_order_relaxed);
    }
    /// Calls errorHook() instead of updateHook() from the next cycle on.
    void error() noexcept RTCF_NONBLOCKING {
        if (getTaskState() == Running) enterState(RunTimeError);
    }
    /// Calls updateHook() again from the next cycle on.
    /// @return true if the component is in state Running
    bool recover() noexcept RTCF_NONBLOCKING {
        if (inRunTimeError()) enterState(Running);
        return getTaskState() == Running;
    }
    /// @}
    /// Throw, which stops the loop in order.
    /// @{
    [[noreturn]] void exception() const { throw std::runtime_error("exception() was called"); }
    [[noreturn]] void fatal() const { throw std::runtime_error("fatal() was called"); }
    /// @}

    DataFlowInterface* ports() noexcept { return &ports_; }
    base::PortInterface& addPort(base::PortInterface& port) { return ports_.addPort(port); }
    base::PortInterface& addPort(const std::string& name, base::PortInterface& port) {
        return ports_.addPort(name, port);
    }
    template <typename... Arguments>
    base::PortInterface& addEventPort(Arguments&&... arguments) {
        return ports_.addEventPort(std::forward<Arguments>(arguments)...);
    }
    base::PortInterface* getPort(const std::string& name) const noexcept {
        return ports_.getPort(name);
    }

    /// Declares a parameter with the variable's value as default. From then on the variable follows
    /// the parameter: it is updated before each hook, and before updateHook(); a text only before
    /// the other hooks. Not real-time safe.
    /// @throws std::logic_error if the name is taken or not legal, and after the constructor, as
    /// the loader sets parameters before configureHook()
    template <typename T>
    Described& addProperty(const std::string& name, T& variable) {
        if (constructed_) {
            throw std::logic_error("property '" + name +
                                   "' is added too late: add it in the constructor");
        }
        properties_.push_back(std::make_unique<Property<T>>(this, name, variable));
        return *properties_.back();
    }
    /// Logs a warning that rtcf cannot call operations.
    template <typename... Arguments>
    Described& addOperation(const std::string& name, Arguments&&...) {
        sayNotCallable(name);
        return service_;
    }
    Service* provides() noexcept { return &service_; }
    /// Ignores the service's name: its properties are parameters of the component.
    Service* provides(const std::string&) noexcept { return &service_; }

   private:
    bool configure() final {
        constructed_ = true;
        return enter(Stopped, [this] { return configureHook(); });
    }
    bool start() final {
        return enter(Running, [this] { return startHook(); });
    }
    void update() final {
        const ::rtcf::rtt_compat::InHook hook(this);
        for (const auto& property : properties_) property->bring(true);
        ports_.callBack();
        if (inRunTimeError()) {
            errorHook();
        } else {
            updateHook();
        }
    }
    void stop() final {
        enter(Stopped, [this] { return stopHook(), true; });
    }
    void cleanup() final {
        enter(PreOperational, [this] { return cleanupHook(), true; });
    }

    void enterState(TaskState next) noexcept RTCF_NONBLOCKING {
        target_.store(next, std::memory_order_relaxed);
        state_.store(next, std::memory_order_relaxed);
    }

    // The state changes when the hook has succeeded; if it throws or returns false, the state
    // stays.
    template <typename Hook>
    bool enter(TaskState next, const Hook& hook) {
        const ::rtcf::rtt_compat::InHook here(this);
        for (const auto& property : properties_) property->bring(false);
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

    void sayNotCallable(const std::string& name) const {
        static constexpr ::rtcf::LogSite kSite{::rtcf::LogLevel::Warn, "", 0, "addOperation", "{}"};
        if (!logs(kSite.level)) return;
        ::rtcf::rtt_compat::LogBuffer text;
        text.append("operation '");
        text.append(name);
        text.append("' cannot be called in rtcf: offer a ROS service by getNodeHandle() instead");
        ::rtcf::rtt_compat::log(*this, kSite, text.text());
    }

    std::string given_name_;
    DataFlowInterface ports_;
    Service service_;
    std::vector<std::unique_ptr<base::PropertyBase>> properties_;
    bool constructed_ = false;
    // Written in hooks of one thread, read in hooks of others.
    std::atomic<TaskState> state_{PreOperational};
    std::atomic<TaskState> target_{PreOperational};
};

template <typename T>
Described& Service::addProperty(const std::string& name, T& variable) {
    return owner_->addProperty(name, variable);
}
template <typename... Arguments>
Described& Service::addOperation(const std::string& name, Arguments&&... arguments) {
    return owner_->addOperation(name, std::forward<Arguments>(arguments)...);
}

}  // namespace RTT
