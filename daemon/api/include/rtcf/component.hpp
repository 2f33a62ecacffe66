/// @file
/// The component: a controller, filter, driver or any other block of a control
/// loop, with a lifecycle, typed ports and parameters.
///
/// The hooks run in the order configure, start, update…, stop, cleanup. Only
/// update(), safe() and takeOver() run in the real-time thread: they must not
/// allocate, lock, block or make system calls. Ports, parameters and state are
/// members, which register themselves with the component. The component cannot
/// register any more members after configure().
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtcf/component_memory.hpp"
#include "rtcf/derived.hpp"
#include "rtcf/logging.hpp"
#include "rtcf/mailbox.hpp"
#include "rtcf/node_gate.hpp"
#include "rtcf/parameter.hpp"
#include "rtcf/port.hpp"
#include "rtcf/queue.hpp"
#include "rtcf/realtime.hpp"
#include "rtcf/registration.hpp"
#include "rtcf/slot.hpp"
#include "rtcf/state.hpp"

namespace rtcf {

template <typename C>
class ComponentAccess;

/// Device input and output of a component, see RTCF_DEVICE_IO. The cycle thread writes it; any
/// thread may read it.
struct DeviceStatistics {
    std::atomic<std::uint64_t> calls{0};   ///< number of RTCF_DEVICE_IO scopes
    std::atomic<std::int64_t> time_ns{0};  ///< total time spent in these scopes, ns
};

/// Receives the faults that a component reports.
class FaultSink {
   public:
    /// Real-time safe.
    /// @param text must live as long as the component
    virtual void report(std::uint64_t iteration, const char* text) noexcept RTCF_NONBLOCKING = 0;

   protected:
    ~FaultSink() = default;
};

/// A component's name, clock and links to the executor. Owned by the executor; outlives the
/// component.
struct ComponentContext {
    std::string full_name;             ///< namespace and name, e.g. "/arm/H1"
    std::string name;                  ///< base name, e.g. "H1"
    std::string ns = "/";              ///< namespace
    std::string runner;                ///< name of the runner
    const LoopClock* clock = nullptr;  ///< the loop's clock
    std::int64_t period_ns = 0;        ///< nominal period of this component, ns
    std::int64_t elapsed_ns = 0;       ///< time since its last update, ns; 0 if it runs every cycle
    /// Sum of the clock's elapsed_ns at its last update, ns; -1 before the first one. Only for
    /// components that do not run every cycle.
    std::int64_t updated_ns = -1;
    bool disabled = false;               ///< taken out after a fault; written by the cycle thread
    std::uint32_t recorder_slot = 0;     ///< slot number in the flight recorder
    DeviceStatistics* device = nullptr;  ///< null outside an executor
    FaultSink* faults = nullptr;         ///< null outside an executor
    LogSink* log = nullptr;              ///< null = no log
    NodeGate* gate = nullptr;            ///< access to the ROS node; null without one
    std::vector<std::pair<std::string, std::string>> remaps;  ///< resolved names (from, to)
    std::atomic<LogLevel> log_level{LogLevel::Info};          ///< least severe level that is logged
    LogMemory said;                     ///< state of the _ONCE and _THROTTLE macros
    ComponentMemory* memory = nullptr;  ///< of the component and its values; null = the heap
    std::size_t object_size = 0;        ///< of the component, bytes; set before its constructor
};

inline ComponentMemory* detail::memoryFor(ComponentContext* context, std::size_t size) noexcept {
    if (context == nullptr) return nullptr;
    context->object_size = size;
    return context->memory;
}

/// Base class of all components.
class Component {
   public:
    Component() = default;
    virtual ~Component();
    Component(const Component&) = delete;
    Component& operator=(const Component&) = delete;

    /// @name Memory
    /// The executor's, see component_memory.hpp. A component with another base class that has
    /// operators new and delete declares `using Component::operator new;` and
    /// `using Component::operator delete;`. Not real-time.
    /// @{
    static void* operator new(std::size_t size) {
        return detail::newObject(size, alignof(std::max_align_t));
    }
    static void* operator new(std::size_t size, std::align_val_t alignment) {
        return detail::newObject(size, static_cast<std::size_t>(alignment));
    }
    static void* operator new(std::size_t size, const std::nothrow_t& /*nothrow*/) noexcept {
        try {
            return operator new(size);
        } catch (...) {
            return nullptr;
        }
    }
    static void* operator new(std::size_t size, std::align_val_t alignment,
                              const std::nothrow_t& /*nothrow*/) noexcept {
        try {
            return operator new(size, alignment);
        } catch (...) {
            return nullptr;
        }
    }
    static void* operator new(std::size_t /*size*/, void* place) noexcept { return place; }
    static void operator delete(void* object) noexcept { detail::deleteObject(object); }
    static void operator delete(void* object, const std::nothrow_t& /*nothrow*/) noexcept {
        detail::deleteObject(object);
    }
    static void operator delete(void* /*object*/, void* /*place*/) noexcept {}
    static void operator delete(void* object, std::align_val_t /*alignment*/) noexcept {
        detail::deleteObject(object);
    }
    static void operator delete(void* object, std::align_val_t /*alignment*/,
                                const std::nothrow_t& /*nothrow*/) noexcept {
        detail::deleteObject(object);
    }
    /// @}

    /// @name Hooks
    /// A hook fails by returning false or by throwing. The executor then rejects the change that
    /// called it; fail() sets the error text.
    /// @{
    /// Checks a batch of parameter values as a whole, and stages the values computed from them in
    /// Derived members. Called before configure() and before each change of parameters. Not
    /// real-time.
    virtual bool prepare(const Values& proposed) {
        (void)proposed;
        return true;
    }
    /// Opens devices and allocates memory. Not real-time.
    virtual bool configure() { return true; }
    virtual bool start() { return true; }  ///< Called before the loop runs. Not real-time.
    virtual void update() = 0;             ///< Runs one cycle. Real-time.
    /// Writes safe commands. Called once instead of update():
    /// - when the loop ends for any reason but a crash,
    /// - after an update() of this component that threw,
    /// - when the component is unloaded or replaced while the loop runs.
    /// It is an ordinary cycle, in schedule order: the component can read its inputs, and later
    /// components and ROS receive its outputs. update() may have thrown anywhere, so safe() must
    /// not rely on values that update() leaves half done. Real-time.
    virtual void safe() noexcept {}
    virtual void stop() {}     ///< Called after the loop has ended. Not real-time.
    virtual void cleanup() {}  ///< Undoes configure(). Not real-time.
    /// Takes over values from the component that this one replaces. Called at the cycle boundary of
    /// the replacement, before the first update(). The executor has already copied state of the
    /// same name and type; this hook converts state whose name, type or meaning has changed.
    /// Real-time.
    virtual void takeOver(const Predecessor& previous) noexcept { (void)previous; }
    /// @}

    /// @name Identity; real-time safe; valid from configure() on
    /// @{
    /// Base name, e.g. "H1".
    const std::string& name() const noexcept { return context_->name; }
    /// Name with namespace, e.g. "/arm/H1".
    const std::string& fullName() const noexcept { return context_->full_name; }
    /// Name of the runner, e.g. "rt_runner".
    const std::string& runner() const noexcept { return context_->runner; }
    /// @}

    /// @name Time; real-time safe
    /// Constant during a cycle and the same for all components. Components use no other clock, so
    /// that they also work in simulation and replay.
    /// @{
    /// Monotonic loop time of this cycle, ns; simulated under simulated time.
    std::int64_t time() const noexcept RTCF_NONBLOCKING { return now_; }
    /// ROS time of this cycle, for message headers, ns since 1970.
    std::int64_t stamp() const noexcept RTCF_NONBLOCKING { return context_->clock->stamp_ns; }
    /// Cycles since the loop started; 0 in the first one.
    std::uint64_t iteration() const noexcept RTCF_NONBLOCKING { return context_->clock->iteration; }
    /// This component's nominal period, ns.
    std::int64_t period() const noexcept RTCF_NONBLOCKING { return context_->period_ns; }
    /// Time since this component's last update, in whole periods, ns. Always positive. In the cycle
    /// in which the frequency changes, it still counts the previous period.
    std::int64_t elapsed() const noexcept RTCF_NONBLOCKING {
        return std::max<std::int64_t>(context_->clock->elapsed_ns, context_->elapsed_ns);
    }
    /// elapsed() in s: the step of an integral or a derivative.
    double dt() const noexcept RTCF_NONBLOCKING { return 1e-9 * static_cast<double>(elapsed()); }
    /// This component's nominal frequency, Hz.
    double frequency() const noexcept RTCF_NONBLOCKING {
        return 1e9 / static_cast<double>(context_->period_ns);
    }
    /// @}

    /// @name For the logging macros; real-time safe
    /// @{
    /// True if the component logs records of this level.
    bool logs(LogLevel level) const noexcept RTCF_NONBLOCKING {
        return context_->log != nullptr &&
               level >= context_->log_level.load(std::memory_order_relaxed);
    }
    LogSink& logSink() const noexcept RTCF_NONBLOCKING { return *context_->log; }
    LogMemory& logMemory() const noexcept RTCF_NONBLOCKING { return context_->said; }
    /// @}

   protected:
    /// Reports a fault that does not end the loop, such as a lost sensor. `rtcfctl list` then shows
    /// the component as faulted, with the text, an event tells it, and `rtcfctl stats` counts each
    /// call. Call it in each cycle of the fault: the log repeats it only after a while. Real-time
    /// safe.
    /// @param text must live as long as the component, e.g. "measured is not finite"
    void reportFault(const char* text) const noexcept RTCF_NONBLOCKING {
        if (context_->faults != nullptr) context_->faults->report(iteration(), text);
    }
    /// Sets the error text of a hook: `return fail("no reply from {}", device);`. Without
    /// arguments, the text is used verbatim. RTCF_FAIL(this, …) checks the format at compile time.
    /// Not real-time.
    /// @return false, as the result of the hook
    template <typename Text, typename... Arguments>
    [[nodiscard]] bool fail(const Text& text, const Arguments&... arguments) {
        const std::string_view shown = detail::textOrNull(text);
        rest_->failure = shown;
        if constexpr (sizeof...(arguments) != 0) {
            try {
                rest_->failure = fmt::format(fmt::runtime(shown), detail::textOrNull(arguments)...);
            } catch (const fmt::format_error&) {  // the format is wrong: it is the text
            }
        }
        return false;
    }

   private:
    friend struct AbiProbe;
    template <typename C>
    friend class ComponentAccess;
    static ComponentContext& detached() {
        static const LoopClock clock{};
        static ComponentContext context;
        context.clock = &clock;
        return context;
    }

    ComponentContext* context_ =
        detail::under_construction != nullptr ? detail::under_construction : &detached();
    // Kept outside the object, so that the derived class's ports, which each cycle touches, lie
    // close together.
    struct Rest {
        bool frozen = false;             // no more members
        bool parameters_frozen = false;  // no more parameters
        std::vector<std::unique_ptr<InputPort>> input_ports;
        std::vector<InputPort*> inputs;
        std::vector<OutputPort*> outputs;
        std::vector<ParameterBase*> parameters;
        std::vector<DerivedBase*> derived;
        std::vector<MailboxBase*> mailboxes;
        std::vector<StateDeclaration> states;
        std::vector<OutputPort*> staged_outputs;
        std::string failure;
        std::vector<std::string> ended;  // members that ended before the component
    };
    std::unique_ptr<Rest> rest_ = std::make_unique<Rest>();
    Shared<std::int64_t> now_ = 1;  // loop time; stamps of outputs must not be 0
};

/// A component whose device paces the loop. A runner has at most one; its frequency is then
/// nominal.
class Source : public Component {
   public:
    /// Waits for the device. Called in the real-time thread instead of its sleep. Real-time; it may
    /// block until the deadline, but no longer.
    /// @param deadline_ns latest time to return, CLOCK_MONOTONIC, ns
    /// @return true if the device is ready and a cycle begins
    virtual bool wait(std::int64_t deadline_ns) noexcept = 0;
};

}  // namespace rtcf

/// Component::fail() with a format that is checked at compile time, for hooks: `return
/// RTCF_FAIL(this, "no reply from {}", device);`. Not real-time.
/// @return false
#define RTCF_FAIL(self, text, ...)                                                   \
    (false ? ::rtcf::detail::formatCheck(FMT_STRING(text), ##__VA_ARGS__) : (void)0, \
     (self)->fail(text, ##__VA_ARGS__))

#include "rtcf/component_access.hpp"

namespace rtcf {

inline Component::~Component() {
    // Members outside of the component's class may end later.
    accessTo(*this).forgetMembers();
}

inline void detail::endMember(const void* member) noexcept {
    Component* const owner = memberOwners().take(member);
    if (owner != nullptr) accessTo(*owner).end(member);
}

template <typename T>
void State<T>::declareIn(Component* owner, StateDeclaration declaration) {
    accessTo(*owner).declare(std::move(declaration));
}

inline const StateDeclaration* Predecessor::findState(std::string_view name) const noexcept {
    for (const StateDeclaration& state : accessTo(component_).states()) {
        if (state.name == name) return &state;
    }
    return nullptr;
}

template <typename T>
const T* Predecessor::output(std::string_view name) const noexcept {
    for (const OutputPort* output : accessTo(component_).outputs()) {
        if (output->name() != name) continue;
        const bool there = output->slot()->stamp != 0 && sameType(output->type(), typeInfo<T>());
        return there ? &static_cast<const Slot<T>*>(output->slot().get())->value : nullptr;
    }
    return nullptr;
}

inline InputBase::InputBase(Component* owner, std::string name, const TypeInfo& type,
                            const SlotHeader& empty, PortTexts texts)
    : source_(&empty) {
    accessTo(*owner).declare(
        std::make_unique<InputPort>(*this, *owner, std::move(name), type, std::move(texts)));
}

inline std::int64_t InputBase::age(const Component* owner) const noexcept RTCF_NONBLOCKING {
    if (source_->stamp == 0) return -1;
    return std::max<std::int64_t>(0, owner->time() - timeOf(source_->stamp));
}

inline bool InputBase::connected(const Component* owner) const noexcept RTCF_NONBLOCKING {
    for (const InputPort* port : accessTo(*owner).inputs())
        if (&port->input() == this) return port->connected();
    return false;
}

inline QueueBase::QueueBase(Component* owner, std::string name, const TypeInfo& type,
                            const Ring& ring, PortTexts texts)
    : InputBase(owner, std::move(name), type, kNoValue, std::move(texts)), ring_(new Ring(ring)) {
    ring_->port = accessTo(*owner).inputs().back();
    ring_->port->setQueue(this);
}

inline std::int64_t QueueBase::age() noexcept {
    const SlotHeader* const slot = oldest();
    if (slot == nullptr) return -1;
    return std::max<std::int64_t>(0, ring_->port->owner().time() - timeOf(slot->stamp));
}

inline OutputBase::OutputBase(Component* owner, std::string name, PortTexts texts,
                              const TypeInfo& type, const Finite* finite)
    : now_(&accessTo(*owner).now()),
      port_(std::make_unique<OutputPort>(*this, std::move(name), std::move(texts), type, finite)) {
    raw_ = port_->written();
    accessTo(*owner).declare(port_.get());
}

inline DerivedBase::DerivedBase(Component* owner) { accessTo(*owner).declare(this); }

inline MailboxBase::MailboxBase(Component* owner) : now_(&accessTo(*owner).now()) {
    accessTo(*owner).declare(this);
}

inline ParameterBase::ParameterBase(Component* owner, ParameterDeclaration declaration,
                                    const void* place)
    : declaration_(std::move(declaration)), place_(place) {
    ParameterValue initial = declaration_.default_value;
    if (const std::string why = check(initial); !why.empty())
        throw std::logic_error("default value: " + why);
    accessTo(*owner).declare(this);
}

inline std::string ParameterBase::check(ParameterValue& value) const {
    const auto& [name, type, initial, minimum, maximum, unit, doc, choices, is_size, fixed] =
        declaration_;
    if (type == "double" && std::holds_alternative<std::int64_t>(value)) {
        value = static_cast<double>(std::get<std::int64_t>(value));
    }
    if (value.index() != initial.index()) {
        static constexpr std::array<const char*, 4> kNames{"a bool", "an int", "a double",
                                                           "a string"};
        const auto* text = std::get_if<std::string>(&value);
        return fmt::format(
            "parameter {} takes {}, not {}", name,
            type == "enum" ? "a name" : kNames[initial.index()],
            text ? fmt::format("the text \"{:.40}\"", *text) : kNames[value.index()]);
    }
    double number = 0.0;
    if (const auto* real = std::get_if<double>(&value)) {
        if (!std::isfinite(*real)) {
            // Only the declared default may be infinite or NaN.
            return sameValue(value, initial) ? std::string()
                                             : fmt::format("parameter {} must be finite", name);
        }
        number = *real;
    } else if (const auto* integer = std::get_if<std::int64_t>(&value)) {
        number = static_cast<double>(*integer);
    }
    if (minimum && number < *minimum) {
        return fmt::format("parameter {} = {} is below its minimum {} {}", name, number, *minimum,
                           unit);
    }
    if (maximum && number > *maximum) {
        return fmt::format("parameter {} = {} is above its maximum {} {}", name, number, *maximum,
                           unit);
    }
    if (!choices.empty()) {
        std::string names;
        for (const Choice& choice : choices) {
            if (choice.name == std::get<std::string>(value)) return {};
            names += (names.empty() ? "" : ", ") + choice.name;
        }
        return fmt::format("parameter {} = {} is none of {}", name, std::get<std::string>(value),
                           names);
    }
    return {};
}

}  // namespace rtcf

#include "rtcf/abi.hpp"
#include "rtcf/device_io.hpp"
