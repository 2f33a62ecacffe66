/// @file
/// Interface of the executor to a link with the world outside its loop, such as the ROS node. The
/// executor knows nothing else of ROS.
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

/// A parameter's declaration and value.
struct ParameterView {
    ParameterDeclaration declaration;
    ParameterValue value;
    bool given = false;  ///< the component was loaded with a value, perhaps the default
};

/// The parameters of a component. Immutable: a new value makes a new object.
struct ParameterSet {
    std::string full_name;  ///< the component's full name
    std::vector<ParameterView> parameters;
};

/// The mapped connections and the components with parameters of one generation of the graph. The
/// names and types of topics are in the taps and injectors.
struct BridgeTable {
    std::vector<std::shared_ptr<Tap>> outputs;                    ///< outputs to publish
    std::vector<std::shared_ptr<Injector>> inputs;                ///< inputs to subscribe
    std::vector<std::shared_ptr<const ParameterSet>> parameters;  ///< parameters to offer
};

/// A batch of parameter changes (name, value).
using ParameterBatch = std::vector<std::pair<std::string, ParameterValue>>;

/// Effect of one rejected value on the others of its batch.
enum class BatchPolicy {
    Whole,  ///< all values are rejected
    Each,   ///< the others take effect
};

/// Function by which a bridge requests a change of a component's parameters. Any thread; returns at
/// once.
/// @param batch takes effect at one cycle if no value is rejected
/// @param done called once by the graph thread, with the error text or an empty string; not called
/// if the runner ends first
using ParameterRequest =
    std::function<void(const std::string& component, ParameterBatch batch, BatchPolicy policy,
                       std::function<void(const std::string&)> done)>;

/// Settings of a bridge.
struct BridgeSettings {
    bool enabled = true;
    std::string master_uri;  ///< empty = from the environment
    std::string hostname;    ///< host name for peers; empty = from the environment
    /// Namespace of the topics of cycles, of services and, when the node starts, of its name; not
    /// of ports. Empty = the node's own name.
    std::string name_space;
    std::uint32_t queue = 1000;    ///< messages kept for a slow subscriber
    std::string latch;             ///< regular expression of latched outputs
    std::uint32_t decimation = 1;  ///< publish every n-th value of an output
    std::string decimate = ".*";   ///< regular expression of outputs that are decimated
    std::string stamped;  ///< regular expression of scalar outputs published with the cycle's stamp
    /// Largest message of a type of variable size, bytes.
    std::uint32_t largest_message = 256 * 1024;
    Right peers = Right::Observe;      ///< right of unauthenticated peers
    bool refuse_out_of_range = false;  ///< reject out-of-range parameters of peers; else clamp them
};

/// Status of a bridge.
struct BridgeStatus {
    bool enabled = false;
    bool connected = false;
    std::string node;
    std::string master_uri;
    std::uint32_t publications = 0;
    std::uint32_t subscriptions = 0;
    std::string problem;                 ///< one line; empty = none
    bool killed = false;                 ///< a peer has requested a shutdown
    std::optional<bool> simulated_time;  ///< the peers use simulated time; unset = not known yet
    bool follows_clock = false;          ///< ticks go to the clock of setClock()
};

class RunnerView;

/// A link between taps and injectors and their peers outside. All calls come from one thread that
/// is not real-time, and return at once; the bridge works in threads of its own.
class Bridge {
   public:
    virtual ~Bridge() = default;

    /// Sets the runner, which outlives the bridge. Called once, before all other functions.
    virtual void attach(RunnerView& /*runner*/) {}

    /// Changes the settings. The first call starts the bridge.
    virtual void configure(const BridgeSettings& settings) = 0;

    /// Changes the connections. Removed ones are closed; those that stay (the same object) continue
    /// undisturbed.
    virtual void setTable(std::shared_ptr<const BridgeTable> table) = 0;

    /// Sets the receiver of the peers' simulated clock; null = none.
    virtual void setClock(std::shared_ptr<SimulatedClock> clock) = 0;

    virtual BridgeStatus status() const = 0;

    /// True if a peer that publishes the injector's topic is connected.
    virtual bool feeds(const Injector& /*injector*/) const { return false; }

    /// Sets the function that changes parameters. Called once, before configure().
    // NOLINTNEXTLINE(performance-unnecessary-value-param): to be kept
    virtual void serveParameters(ParameterRequest /*request*/) {}

    /// Access of hooks to the outside; null if there is none. Lives as long as the bridge.
    virtual HookGate* hooks() noexcept { return nullptr; }
};

/// Reports that a bridge's state has changed, one line; callable from any thread.
using BridgeReport = std::function<void(const std::string& message)>;

}  // namespace rtcf::executor
