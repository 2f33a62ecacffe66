/// @file
/// What the executor asks of a link to the world outside its loop, such as the
/// ROS node. The executor knows no more of ROS than this.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bridge/hook_gate.hpp"
#include "bridge/injector.hpp"
#include "bridge/tap.hpp"

namespace rtcf::executor {

class SimulatedClock;

/// All mapped connections of one generation of the graph. The topic's name and
/// type are the tap's and the injector's.
struct BridgeTable {
    std::vector<std::shared_ptr<Tap>> outputs;      ///< to be published
    std::vector<std::shared_ptr<Injector>> inputs;  ///< to be subscribed
};

/// What a bridge needs to know to find its peers.
struct BridgeSettings {
    bool enabled = true;
    std::string master_uri;      ///< empty: of the environment
    std::string hostname;        ///< by which peers reach us; empty: of the environment
    std::uint32_t queue = 1000;  ///< messages kept for a slow subscriber
    bool operator==(const BridgeSettings& other) const {
        return enabled == other.enabled && master_uri == other.master_uri &&
               hostname == other.hostname && queue == other.queue;
    }
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
    std::optional<bool> simulated_time;  ///< of the peers; nothing = they have not been asked yet
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

    /// What hooks reach the outside by; null if they do not. As long as the bridge.
    virtual HookGate* hooks() noexcept { return nullptr; }
};

/// Reports that a bridge's state has changed, one line; callable from any thread.
using BridgeReport = std::function<void(const std::string& message)>;

}  // namespace rtcf::executor
