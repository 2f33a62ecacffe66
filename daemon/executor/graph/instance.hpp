/// @file
/// One loaded component: the object, its names, its lifecycle. Owned by the graphs that contain it;
/// all calls come from the graph thread. A hook that throws or fails makes the call throw an Error
/// that names component and hook.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "faults/flight_recorder.hpp"
#include "graph/definition.hpp"
#include "graph/hook_gate.hpp"
#include "logging/log.hpp"
#include "loop/schedule.hpp"
#include "plugins/library.hpp"
#include "rtcf/component.hpp"

namespace rtcf::executor {

/// A port of a component, with the name that it is mapped to. Types are never unloaded.
struct MappedPort {
    std::string name;
    std::string mapped_name;
    PortTexts texts;
    const TypeInfo* type;
    bool output;
};

class Instance {
   public:
    /// Constructs the component and checks and sets its load-time parameters.
    /// @param gate access of hooks to ROS; null = none
    /// @throws Error if that fails; nothing is left behind then
    Instance(ComponentDefinition definition, std::shared_ptr<const Library> library,
             const std::string& runner, const LoopClock& clock, Log& log, FlightRecorder& recorder,
             HookGate* gate = nullptr);
    /// Stops and cleans up the component if necessary, and drains its log records.
    ~Instance();
    Instance(const Instance&) = delete;
    Instance& operator=(const Instance&) = delete;

    /// @name Lifecycle; idempotent
    /// @{
    void configure();  ///< Configures and freezes the ports. @throws Error, after cleanup()
    /// Freezes and resolves the ports without configure(), to show how they would be wired.
    void freezePorts();
    void start();  ///< @throws Error
    void stop() noexcept;
    void cleanup() noexcept;
    /// @}

    const ComponentDefinition& definition() const noexcept { return *definition_; }
    /// definition() for a view that may outlive the component.
    std::shared_ptr<const ComponentDefinition> sharedDefinition() const noexcept {
        return definition_;
    }
    const std::string& fullName() const noexcept { return context_.full_name; }
    const Library& library() const noexcept { return *library_; }
    /// The library as a shared pointer, which keeps the code loaded.
    const std::shared_ptr<const Library>& code() const noexcept { return library_; }
    const ComponentRecord& record() const noexcept { return *record_; }
    Component& component() const noexcept { return *component_; }
    ComponentContext& context() noexcept { return context_; }
    const std::shared_ptr<ComponentStatistics>& statistics() const noexcept { return statistics_; }

    /// All inputs(), then all outputs() of the component. It may outlive the component. After
    /// configure().
    const std::shared_ptr<const std::vector<MappedPort>>& ports() const noexcept { return ports_; }
    /// Position of an output in ports().
    std::size_t placeOfOutput(std::size_t output) const noexcept {
        return accessTo(*component_).inputs().size() + output;
    }
    /// A slot with the output's capacity after configure(), to make copies from.
    const SlotHeader* sample(std::size_t output) const noexcept { return samples_[output].get(); }
    /// Remaps that match no port of the component; after configure().
    std::vector<std::string> uselessRemaps() const;
    /// The component's slot in the flight recorder.
    std::uint32_t slot() const noexcept { return slot_.number; }
    /// Cycle modulo `every` in which the component runs. Chosen once, so that changes of other
    /// components do not move it.
    std::uint32_t phase() const noexcept { return phase_.value_or(0); }
    bool hasPhase() const noexcept { return phase_.has_value(); }
    void setPhase(std::uint32_t phase) noexcept { phase_ = phase; }
    /// The component as a Source; null if it is none.
    Source* source() const noexcept { return dynamic_cast<Source*>(component_.get()); }
    /// Frees staged values and values that an adopted batch has replaced.
    void releaseStaged() noexcept;
    InputPort* findInput(const std::string& port) const noexcept;
    /// @throws Error that lists the inputs
    const InputPort& requireInput(const std::string& port) const;

    /// The parameters' values as last staged, in the order of declaration.
    const std::vector<ParameterValue>& parameterValues() const noexcept {
        return parameter_values_;
    }
    /// Inherited parameters that the component has taken, except those equal to its default.
    const std::vector<std::pair<std::string, ParameterValue>>& keptParameters() const noexcept {
        return kept_parameters_;
    }
    /// Inherited parameters that were not taken, one line each.
    const std::vector<std::string>& lostParameters() const noexcept { return lost_parameters_; }
    /// Undoes a batch that the loop did not adopt.
    void restoreParameterValues(std::vector<ParameterValue> values);
    /// Checks and stages a batch, and calls prepare().
    /// @return the values to commit at the boundary
    /// @throws Error naming the first invalid parameter; nothing is staged then
    std::vector<StagedValue*> stageParameters(
        const std::vector<std::pair<std::string, ParameterValue>>& batch);

    /// Text of the exception from update(); empty = none.
    const std::string& faultText() const noexcept { return fault_; }
    void setFault(std::string text) { fault_ = std::move(text); }

   private:
    void setFirstParameters();
    void setHookTime() noexcept;
    // @throws Error if a member has ended
    void requireMembers() const;
    void callHook(Hook hook, const std::function<bool()>& call);
    /// Calls a hook whose failure rejects nothing: errors are logged.
    void callLastHook(Hook hook, const std::function<void()>& call) noexcept;

    std::shared_ptr<ComponentDefinition> definition_;
    std::shared_ptr<const Library> library_;
    const ComponentRecord* record_;
    Log& log_;
    FlightRecorder& recorder_;
    HookGate* gate_;

    // Members that surround the component's life. They are destroyed in reverse order, also if the
    // constructor throws: first the component, then its log level, then its log records, which
    // refer to its name.
    struct Slot {
        Slot(FlightRecorder& in, const std::string& name)
            : recorder(in), number(in.addSlot(name)) {}
        ~Slot() { recorder.removeSlot(number); }
        Slot(const Slot&) = delete;
        Slot& operator=(const Slot&) = delete;
        FlightRecorder& recorder;
        const std::uint32_t number;
    };
    struct Drained {
        explicit Drained(Log& drained) : log(drained) {}
        ~Drained() {
            try {
                log.drain();
            } catch (...) {  // NOLINT(bugprone-empty-catch)
                // No memory for the texts: the records are lost.
            }
        }
        Drained(const Drained&) = delete;
        Drained& operator=(const Drained&) = delete;
        Log& log;
    };
    struct Level {
        Level(LogLevels& of, ComponentContext& component) : levels(of), level(component.log_level) {
            levels.attach(component.full_name, level);
        }
        ~Level() { levels.detach(level); }
        Level(const Level&) = delete;
        Level& operator=(const Level&) = delete;
        LogLevels& levels;
        std::atomic<LogLevel>& level;
    };
    const Slot slot_;
    ComponentContext context_;
    std::shared_ptr<ComponentStatistics> statistics_ = std::make_shared<ComponentStatistics>();
    const Drained drained_;
    std::optional<const Level> level_;
    std::unique_ptr<Component> component_;

    std::optional<std::uint32_t> phase_;
    std::vector<ParameterValue> parameter_values_;
    bool has_parameters_ = false;  // of the load; fixed ones no longer change
    std::vector<std::pair<std::string, ParameterValue>> kept_parameters_;
    std::vector<std::string> lost_parameters_;
    std::shared_ptr<const std::vector<MappedPort>> ports_;
    std::vector<std::shared_ptr<SlotHeader>> samples_;
    bool configured_ = false;
    bool started_ = false;
    std::string fault_;
};

}  // namespace rtcf::executor
