/// @file
/// Test bench for one component, without daemon, executor or ROS master: the test sets its ports
/// and its clock. Build the test program from the component's own source file.
///
///     TEST(Pi, StaysWithinItsLimit) {
///         rtcf::test::Bench pi("Pi", {{"kp", 100.0}, {"limit", 2.0}});
///         pi.write("setpoint", 1.0);
///         pi.write("measured", 0.0);
///         pi.cycle();
///         EXPECT_EQ(*pi.read<double>("effort"), 2.0);
///     }
///
/// Not real-time; all calls come from one thread. A wrong name or type throws
/// std::invalid_argument; a failing hook throws std::runtime_error with the hook's error text.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::test {

class Bench {
   public:
    using Parameters = std::vector<std::pair<std::string, ParameterValue>>;

    /// Makes a component, sets its parameters and configures it.
    /// @param type name of the component type, as registered
    /// @param parameters pairs (name, value)
    /// @param period_ns the loop's period, ns
    explicit Bench(const std::string& type, const Parameters& parameters = {},
                   std::int64_t period_ns = 1'000'000)
        : log_(lines_) {
        clock_.period_ns = period_ns;
        clock_.elapsed_ns = period_ns;
        clock_.time_ns = period_ns;
        context_.full_name = "/" + type;
        context_.name = type;
        context_.runner = "test";
        context_.clock = &clock_;
        context_.period_ns = period_ns;
        context_.device = &device_;
        context_.faults = &faults_;
        context_.log = &log_;
        context_.log_level = LogLevel::Debug;
        component_.reset(find(type).create(type.c_str(), &context_));
        accessTo(*component_).attach(context_);
        accessTo(*component_).freezeParameters();
        set(parameters);
        call("configure", [this] { return component_->configure(); });
        configured_ = true;
        if (const auto& ended = accessTo(*component_).ended(); !ended.empty())
            throw std::runtime_error(ended[0] + " ended before the component");
        accessTo(*component_).freeze();
        countWrites();
    }
    ~Bench() {
        for (MailboxBase* mailbox : accessTo(*component_).mailboxes()) mailbox->close();
        if (started_) component_->stop();
        component_->cleanup();
    }
    Bench(const Bench&) = delete;
    Bench& operator=(const Bench&) = delete;

    /// Sets a batch of parameters, as `rtcfctl set` does.
    void set(const Parameters& batch) {
        std::map<std::string, ParameterValue> next;
        try {
            for (const auto& [name, given] : batch) {
                ParameterBase& parameter =
                    named(accessTo(*component_).parameters(), name, "parameter");
                ParameterValue value = given;
                if (const std::string why = parameter.check(value); !why.empty())
                    throw std::invalid_argument(why);
                const auto present =
                    values_.try_emplace(name, parameter.declaration().default_value);
                if (parameter.declaration().fixed && configured_ &&
                    !sameValue(value, present.first->second))
                    throw std::invalid_argument("parameter " + name + " is fixed at the load");
                parameter.stage(value);
                next[name] = value;
            }
            call("prepare", [this] { return component_->prepare(Values{}); });
        } catch (...) {
            release();
            throw;
        }
        for (ParameterBase* parameter : accessTo(*component_).parameters()) {
            if (parameter->staged()) parameter->commit();
        }
        for (DerivedBase* derived : accessTo(*component_).derived()) {
            if (derived->staged()) derived->commit();
        }
        release();
        for (auto& [name, value] : next) values_[name] = std::move(value);
    }

    /// Writes a new value to an input, or one more message to a queue.
    template <typename T>
    void write(const std::string& name, const T& value) {
        InputPort& input = named(accessTo(*component_).inputs(), name, "input");
        requireType(input.type(), typeInfo<T>(), name);
        SlotHeader& slot = slotOf(input);
        static_cast<Slot<T>&>(slot).value = value;
        slot.stamp = now();
        input.inject(&slot);
        if (QueueBase* const queue = input.queue()) queue->receive();
    }

    /// Runs cycles; calls start() before the first one.
    void cycle(std::uint64_t cycles = 1) {
        if (!started_) {
            accessTo(*component_).setTime(now() - 1);  // before the first cycle
            call("start", [this] { return component_->start(); });
            countWrites();
            for (MailboxBase* mailbox : accessTo(*component_).mailboxes()) mailbox->open();
        }
        for (started_ = true; cycles > 0; --cycles) {
            accessTo(*component_).setTime(now());
            component_->update();
            commit();
            clock_.iteration = clock_.iteration + 1;
            clock_.time_ns = clock_.time_ns + clock_.period_ns;
            clock_.stamp_ns = clock_.stamp_ns + clock_.period_ns;
        }
    }
    /// Calls safe(), as at the end of a loop.
    void safe() {
        accessTo(*component_).setTime(now());
        component_->safe();
        commit();
    }

    /// The last value that an output has written; null if it has not written.
    template <typename T>
    const T* read(const std::string& name) const {
        const OutputPort& output = named(accessTo(*component_).outputs(), name, "output");
        requireType(output.type(), typeInfo<T>(), name);
        return output.slot()->stamp == 0 ? nullptr
                                         : &static_cast<const Slot<T>*>(output.slot().get())->value;
    }
    /// Number of cycles and hooks in which an output was written, without those in which the value
    /// of a Finite output was not finite.
    std::uint64_t writes(const std::string& name) const {
        const auto found = writes_.find(&named(accessTo(*component_).outputs(), name, "output"));
        return found == writes_.end() ? 0 : found->second.count;
    }
    /// Number of non-finite values on outputs declared Finite.
    std::uint64_t nonFinite() const noexcept { return non_finite_; }

    /// Number of reportFault() calls.
    std::uint64_t faults() const noexcept { return faults_.count; }
    /// The text of the last one; empty = none.
    const char* fault() const noexcept { return faults_.text; }

    /// A declared state, for reading and writing.
    template <typename T>
    T& state(const std::string& name) {
        for (const StateDeclaration& state : accessTo(*component_).states()) {
            if (state.name != name) continue;
            if (state.identity == StateType<T>::identity() && state.size == sizeof(T))
                return *static_cast<T*>(state.value);
            throw std::invalid_argument("state " + name + " is a " + state.type);
        }
        throw std::invalid_argument("no state " + name);
    }
    /// Takes over declared state of the same name and type from another bench, as `rtcfctl replace`
    /// does.
    void takeOver(const Bench& previous) {
        for (const StateDeclaration& state : accessTo(*component_).states()) {
            for (const StateDeclaration& before : accessTo(*previous.component_).states()) {
                if (before.name == state.name && before.identity == state.identity &&
                    before.size == state.size)
                    std::memcpy(state.value, before.value, state.size);
            }
        }
        accessTo(*component_).setTime(now() - 1);  // before the next cycle
        component_->takeOver(Predecessor(*previous.component_));
    }

    /// The loop's clock. The test may set time and stamp between cycles; a loop's time only rises.
    LoopClock& clock() noexcept { return clock_; }
    /// Number of RTCF_DEVICE_IO scopes so far.
    std::uint64_t deviceCalls() const noexcept { return device_.calls; }
    /// The texts of all log records, of all levels.
    const std::vector<std::string>& log() const noexcept { return lines_; }
    Component& component() noexcept { return *component_; }

   private:
    class Lines final : public LogSink {
       public:
        explicit Lines(std::vector<std::string>& lines) : lines_(lines) {}
        LogRecord* claim() noexcept override { return &record_; }
        void commit(LogRecord* record) noexcept override {
            std::string text;
            record->render(*record, text);
            lines_.push_back(std::move(text));
        }

       private:
        std::vector<std::string>& lines_;
        LogRecord record_{};
    };

    struct Faults final : FaultSink {
        std::uint64_t count = 0;
        const char* text = "";
        void report(std::uint64_t /*iteration*/, const char* of) noexcept override {
            ++count;
            text = of != nullptr ? of : "";
        }
    };

    struct Writes {
        std::uint64_t count = 0;
        std::int64_t last = 0;  // stamp
    };

    static const ComponentRecord& find(const std::string& type) {
        std::string known;
        for (const ComponentRecord* each = rtcf::detail::component_records; each != nullptr;
             each = each->next) {
            if (type == each->type) return *each;
            known += (known.empty() ? "" : ", ") + std::string(each->type);
        }
        throw std::invalid_argument(
            "no component type " + type + " in this program; it has " +
            (known.empty() ? "none: build it from the component's source" : known));
    }

    static std::string nameOf(const ParameterBase& parameter) {
        return parameter.declaration().name;
    }
    template <typename Port>
    static std::string nameOf(const Port& port) {
        return port.name();
    }
    template <typename T>
    static T& named(const std::vector<T*>& members, const std::string& name, const char* what) {
        std::string known;
        for (T* member : members) {
            if (nameOf(*member) == name) return *member;
            known += (known.empty() ? "" : ", ") + nameOf(*member);
        }
        throw std::invalid_argument("no " + std::string(what) + " " + name + "; it has " +
                                    (known.empty() ? "none" : known));
    }
    static void requireType(const TypeInfo& is, const TypeInfo& asked, const std::string& name) {
        if (!sameType(is, asked))
            throw std::invalid_argument("port " + name + " carries " + is.name + ", not " +
                                        asked.name);
    }
    template <typename Hook>
    void call(const char* name, const Hook& hook) {
        accessTo(*component_).clearFailure();
        if (hook()) return;
        const std::string& why = accessTo(*component_).failure();
        throw std::runtime_error(std::string(name) + " failed: " +
                                 (why.empty() ? "it returned false without an error text" : why));
    }
    /// The loop's time; 0 is no stamp.
    std::int64_t now() const { return std::max<std::int64_t>(2, clock_.time_ns); }
    /// Publishes the values of staged outputs.
    void commit() {
        for (OutputPort* output : accessTo(*component_).stagedOutputs())
            if (!output->commit()) ++non_finite_;
        countWrites();
    }
    void countWrites() {
        for (const OutputPort* output : accessTo(*component_).outputs()) {
            Writes& writes = writes_[output];
            if (std::exchange(writes.last, output->slot()->stamp) != output->slot()->stamp)
                ++writes.count;
        }
    }
    void release() {
        for (ParameterBase* parameter : accessTo(*component_).parameters()) parameter->release();
        for (DerivedBase* derived : accessTo(*component_).derived()) derived->release();
    }
    SlotHeader& slotOf(InputPort& input) {
        std::shared_ptr<SlotHeader>& slot = slots_[&input];
        if (slot == nullptr) {
            slot = input.type().make_slot(nullptr);
            input.connect(slot.get(), false);
        }
        return *slot;
    }

    LoopClock clock_;
    ComponentContext context_;
    DeviceStatistics device_;
    Faults faults_;
    std::vector<std::string> lines_;
    Lines log_;
    std::map<const InputPort*, std::shared_ptr<SlotHeader>> slots_;
    std::map<const OutputPort*, Writes> writes_;
    std::uint64_t non_finite_ = 0;
    std::map<std::string, ParameterValue> values_;  // of parameters that were set
    bool configured_ = false;
    bool started_ = false;
    std::unique_ptr<Component> component_;
};

}  // namespace rtcf::test
