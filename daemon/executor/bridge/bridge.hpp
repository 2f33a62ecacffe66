/// @file
/// What the executor asks of a link to the world outside its loop, such as the
/// ROS node. The executor knows no more of ROS than this.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "access/rights.hpp"
#include "exchange/injector.hpp"
#include "exchange/tap.hpp"
#include "graph/hook_gate.hpp"
#include "rtcf/parameter.hpp"

namespace rtcf::executor {

class SimulatedClock;

/// A parameter as it was declared, and its value.
struct ParameterSnapshot {
    ParameterDeclaration declaration;
    ParameterValue value;
};

/// The parameters of a component. Never changed: a new value makes a new one.
struct ParameterSet {
    std::string full_name;  ///< of the component
    std::vector<ParameterSnapshot> parameters;
};

/// All mapped connections of one generation of the graph. The topic's name and
/// type are the tap's and the injector's. And the components that have parameters.
struct BridgeTable {
    std::vector<std::shared_ptr<Tap>> outputs;                    ///< to be published
    std::vector<std::shared_ptr<Injector>> inputs;                ///< to be subscribed
    std::vector<std::shared_ptr<const ParameterSet>> parameters;  ///< to be offered for change
};

/// A batch of parameters on its way in.
using ParameterBatch = std::vector<std::pair<std::string, ParameterValue>>;

/// By which a bridge asks for a change of a component's parameters. Any thread; returns at once.
/// @param done called once by the graph thread, with the reason if it is refused, else empty; not
/// called any more if the runner ends
using ParameterRequest = std::function<void(const std::string& component, ParameterBatch batch,
                                            std::function<void(const std::string&)> done)>;

/// What a bridge needs to know to find its peers.
struct BridgeSettings {
    bool enabled = true;
    std::string master_uri;  ///< empty: of the environment
    std::string hostname;    ///< by which peers reach us; empty: of the environment
    /// Of cycles and services, and at the start of the node its name; not of ports. Empty: the
    /// node's own name.
    std::string name_space;
    std::uint32_t queue = 1000;                  ///< messages kept for a slow subscriber
    std::string latch;                           ///< outputs that are latched; an expression
    std::uint32_t decimation = 1;                ///< each n-th value of an output is published,
    std::string decimate = ".*";                 ///< if its name matches this expression
    std::string stamped;                         ///< scalar outputs that go with the cycle's time
    std::uint32_t largest_message = 256 * 1024;  ///< of a type of variable size, bytes
    Right peers = Right::Observe;                ///< what peers may do, who are strangers
    bool refuse_out_of_range = false;  ///< what peers ask for; else it is brought into the range
};

/// How a bridge fares.
struct BridgeStatus {
    bool enabled = false;
    bool connected = false;
    std::string node;
    std::string master_uri;
    std::uint32_t publications = 0;
    std::uint32_t subscriptions = 0;
    std::string problem;                 ///< one line; empty = none
    bool killed = false;                 ///< a peer has asked it to shut down
    std::optional<bool> simulated_time;  ///< of the peers; nothing = they have not been asked yet
    bool follows_clock = false;          ///< ticks go to the clock of setClock()
};

class RunnerView;

/// A link between taps and injectors and their peers outside. All calls come
/// from one thread that is not real-time and return at once; the work is done
/// in threads of the bridge's own.
class Bridge {
   public:
    virtual ~Bridge() = default;

    /// Once, before anything else: the runner that it serves, which outlives it.
    /// @return true if the bridge takes the runner's cycle records; else they are discarded
    virtual bool attach(RunnerView& runner) {
        (void)runner;
        return false;
    }

    /// The settings to use from now on. The first call lets the bridge begin.
    virtual void configure(const BridgeSettings& settings) = 0;

    /// The connections to serve from now on; what is not in it any more is
    /// closed, what stays in it (the same object) goes on undisturbed.
    virtual void setTable(std::shared_ptr<const BridgeTable> table) = 0;

    /// Ticks of the peers' simulated clock go there from now on; null = nobody wants them.
    virtual void setClock(std::shared_ptr<SimulatedClock> clock) = 0;

    virtual BridgeStatus status() const = 0;

    /// Whether somebody outside feeds an injector now: a peer that publishes its topic is
    /// connected.
    virtual bool feeds(const Injector& /*injector*/) const { return false; }

    /// How parameters are to be changed. Called once, before all else.
    // NOLINTNEXTLINE(performance-unnecessary-value-param): to be kept
    virtual void serveParameters(ParameterRequest /*request*/) {}

    /// What hooks reach the outside by; null if they do not. As long as the bridge.
    virtual HookGate* hooks() noexcept { return nullptr; }
};

/// Reports that a bridge's state has changed, one line; callable from any thread.
using BridgeReport = std::function<void(const std::string& message)>;

}  // namespace rtcf::executor
