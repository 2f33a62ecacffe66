/// @file
/// OROCOS' TaskContext by its name, over rtcf::Component: the hooks, the ports
/// and the states that RTCF 2021's components use.
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

/// Ports are added to it; one belongs to each component.
class DataFlowInterface {
   public:
    using Ports = std::vector<base::PortInterface*>;
    using PortNames = std::vector<std::string>;
    using Callback = std::function<void(base::PortInterface*)>;

    explicit DataFlowInterface(::rtcf::Component* owner) : owner_(owner) {}

    /// @name In the constructor or in configureHook(); the port's address must not change any more
    /// @throws std::logic_error as PortInterface::addTo() does
    /// @{
    base::PortInterface& addPort(base::PortInterface& port) {
        port.addTo(owner_);
        ports_.push_back(&port);
        return port;
    }
    base::PortInterface& addPort(const std::string& name, base::PortInterface& port) {
        port.setName(name);
        return addPort(port);
    }
    /// As addPort(): a component is updated in every cycle, whatever arrives. `callback` is called
    /// in front of updateHook() in cycles in which the port has new data, in the real-time thread.
    base::PortInterface& addEventPort(base::PortInterface& port, Callback callback = {}) {
        addPort(port);
        if (callback) callbacks_.emplace_back(&port, std::move(callback));
        return port;
    }
    base::PortInterface& addEventPort(const std::string& name, base::PortInterface& port,
                                      Callback callback = {}) {
        port.setName(name);
        return addEventPort(port, std::move(callback));
    }
    /// @}

    /// The ports that were added, in that order.
    const Ports& getPorts() const noexcept { return ports_; }
    PortNames getPortNames() const {
        PortNames names;
        for (const base::PortInterface* port : ports_) names.push_back(port->getName());
        return names;
    }
    /// Null if there is none of that name.
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

    /// In the real-time thread, before updateHook().
    void callBack() {
        for (const auto& [port, callback] : callbacks_) {
            if (port->hasNewData()) callback(port);
        }
    }

   private:
    ::rtcf::Component* owner_;
    Ports ports_;
    std::vector<std::pair<base::PortInterface*, Callback>> callbacks_;
};

class TaskContext;

/// The result of provides(): a component has one service, itself.
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

/// The base class of RTCF 2021's components.
class TaskContext : public ::rtcf::Component, public base::TaskCore {
   public:
    using TaskState = base::TaskCore::TaskState;

    /// @param initial_state for source compatibility: configureHook() is always called
    explicit TaskContext(std::string name, TaskState initial_state = Stopped)
        : given_name_(std::move(name)), ports_(this), service_(this) {
        (void)initial_state;
        // Who is being constructed is not known before this.
        if (auto* const slot = ::rtcf::rtt_compat::hookSlot(); slot != nullptr)
            slot->component = this;
    }

    /// @name Hooks, to be overridden; only updateHook() and errorHook() are called in the real-time
    /// thread
    /// @{
    virtual bool configureHook() { return true; }
    virtual bool startHook() { return true; }
    virtual void updateHook() {}
    virtual void errorHook() {}  ///< instead of updateHook() from error() to recover()
    virtual void stopHook() {}
    virtual void cleanupHook() {}
    virtual void exceptionHook() {}  ///< for source compatibility: never called
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
    bool isRunning() const noexcept RTCF_NONBLOCKING { return getTaskState() >= Running; }
    bool isActive() const noexcept RTCF_NONBLOCKING { return isRunning(); }
    bool isConfigured() const noexcept RTCF_NONBLOCKING { return getTaskState() >= Stopped; }
    bool inRunTimeError() const noexcept RTCF_NONBLOCKING { return getTaskState() == RunTimeError; }
    TaskState getTaskState() const noexcept RTCF_NONBLOCKING {
        return state_.load(std::memory_order_relaxed);
    }
    /// Where the hook that runs just now leads to; the same as getTaskState() outside of hooks.
    TaskState getTargetState() const noexcept RTCF_NONBLOCKING {
        return target_.load(std::memory_order_relaxed);
    }
    /// From the next cycle on errorHook() is called.
    void error() noexcept RTCF_NONBLOCKING {
        if (getTaskState() == Running) enterState(RunTimeError);
    }
    /// From the next cycle on updateHook() is called again.
    bool recover() noexcept RTCF_NONBLOCKING {
        if (inRunTimeError()) enterState(Running);
        return getTaskState() == Running;
    }
    /// @}
    /// Ends the loop in order, as any exception out of a hook does.
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

    /// Declares a parameter of a variable's name and value. From then on the variable follows it:
    /// before each hook, and before updateHook(); a text before the other hooks only.
    /// @throws std::logic_error for a name that is taken or not legal, and after the constructor:
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
    /// Compiles, and says in the log that nothing can call the operation here.
    template <typename... Arguments>
    Described& addOperation(const std::string& name, Arguments&&...) {
        sayNotCallable(name);
        return service_;
    }
    Service* provides() noexcept { return &service_; }
    /// Names of services are left out: their properties are parameters of the component.
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

    // The state changes when the hook is over; an exception or a refusal leaves it as it was.
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
    // Written in hooks, read by all of them.
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
