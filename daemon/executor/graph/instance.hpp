/// @file
/// One loaded component: the object, its names, its lifecycle. Owned by the
/// graphs it is in; all calls come from the graph thread. Hooks may throw and
/// fail: what comes out is a Refusal that names component and hook.
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
#include "names/name_pattern.hpp"
#include "plugins/library.hpp"
#include "rtcf/component.hpp"

namespace rtcf::executor {

class Instance {
   public:
    /// Constructs the component and checks and sets its load-time parameters.
    /// @param gate by which hooks reach ROS; null = they do not
    /// @throws Refusal and leaves nothing behind
    Instance(ComponentDefinition definition, std::shared_ptr<const Library> library,
             const std::string& runner, const LoopClock& clock, Log& log, FlightRecorder& recorder,
             HookGate* gate = nullptr);
    /// Stops and cleans up what still is started and configured, and drains the log of what it
    /// said.
    ~Instance();
    Instance(const Instance&) = delete;
    Instance& operator=(const Instance&) = delete;

    /// @name Lifecycle; idempotent
    /// @{
    void configure();  ///< then freezes the ports. @throws Refusal, after cleanup()
    /// Freezes and resolves the ports without configure(), for a look at how it would be wired.
    void freezePorts();
    void start();  ///< @throws Refusal
    void stop() noexcept;
    void cleanup() noexcept;
    /// @}

    const ComponentDefinition& definition() const noexcept { return definition_; }
    const std::string& fullName() const noexcept { return context_.full_name; }
    const Library& library() const noexcept { return *library_; }
    /// Keeps its code loaded.
    const std::shared_ptr<const Library>& code() const noexcept { return library_; }
    const ComponentRecord& record() const noexcept { return *record_; }
    const NamePattern& ignore() const noexcept { return ignore_; }
    Component& component() const noexcept { return *component_; }
    ComponentContext& context() noexcept { return context_; }
    const std::shared_ptr<ComponentFigures>& figures() const noexcept { return figures_; }

    /// Mapped names, in the order of the component's inputs() and outputs(); after configure().
    const std::vector<std::string>& inputNames() const noexcept { return input_names_; }
    const std::vector<std::string>& outputNames() const noexcept { return output_names_; }
    /// A slot with the capacity that configure() gave the output, for copies of it.
    const SlotHeader* sample(std::size_t output) const noexcept { return samples_[output].get(); }
    /// Remaps that name no port of it; after configure().
    std::vector<std::string> uselessRemaps() const;
    /// Its place in the flight recorder.
    std::uint32_t slot() const noexcept { return slot_.number; }
    /// The cycle of its every() in which it runs; chosen once, so that a change of others does not
    /// move it.
    std::uint32_t phase() const noexcept { return phase_.value_or(0); }
    bool hasPhase() const noexcept { return phase_.has_value(); }
    void setPhase(std::uint32_t phase) noexcept { phase_ = phase; }
    /// Not null if it paces the loop.
    Source* source() const noexcept { return dynamic_cast<Source*>(component_.get()); }
    /// Frees what an adopted batch has replaced.
    void releaseStaged() noexcept;
    InputBase* findInput(const std::string& port) const noexcept;
    /// @throws Refusal that lists what there is
    const InputBase& requireInput(const std::string& port) const;

    /// The parameters' values as last staged, in the order of declaration.
    const std::vector<ParameterValue>& parameterValues() const noexcept {
        return parameter_values_;
    }
    /// What it has taken of its definition's `inherited`, but for what is its default anyway.
    const std::vector<std::pair<std::string, ParameterValue>>& keptParameters() const noexcept {
        return kept_parameters_;
    }
    /// What of `inherited` does not fit, a line each.
    const std::vector<std::string>& lostParameters() const noexcept { return lost_parameters_; }
    /// Takes back a batch that the loop did not adopt.
    void restoreParameterValues(std::vector<ParameterValue> values);
    /// Checks a batch, stages it and lets the component prepare for it. @return what to commit at
    /// the boundary @throws Refusal naming the first bad one; nothing is staged then
    std::vector<StagedValue*> stageParameters(
        const std::vector<std::pair<std::string, ParameterValue>>& batch);

    /// What it threw out of update(); empty = nothing.
    const std::string& faultText() const noexcept { return fault_; }
    void setFault(std::string text) { fault_ = std::move(text); }

   private:
    void setFirstParameters();
    void callHook(Hook hook, const std::function<bool()>& call);
    /// Of a hook that cannot refuse any more: what goes wrong is logged.
    void callLastHook(Hook hook, const std::function<void()>& call) noexcept;

    ComponentDefinition definition_;
    std::shared_ptr<const Library> library_;
    const ComponentRecord* record_;
    NamePattern ignore_;
    Log& log_;
    FlightRecorder& recorder_;
    HookGate* gate_;

    // What stands around the component as long as there is one. It goes in the order against this
    // one, also when the constructor refuses: first the component, then its level, then what it
    // has said, whose records refer to its name.
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
                // There is no memory for their texts: they are lost.
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
    std::shared_ptr<ComponentFigures> figures_ = std::make_shared<ComponentFigures>();
    const Drained drained_;
    std::optional<const Level> level_;
    std::unique_ptr<Component> component_;

    std::optional<std::uint32_t> phase_;
    std::vector<ParameterValue> parameter_values_;
    std::vector<std::pair<std::string, ParameterValue>> kept_parameters_;
    std::vector<std::string> lost_parameters_;
    std::vector<std::string> input_names_;
    std::vector<std::string> output_names_;
    std::vector<std::shared_ptr<SlotHeader>> samples_;
    bool configured_ = false;
    bool started_ = false;
    std::string fault_;
};

}  // namespace rtcf::executor
