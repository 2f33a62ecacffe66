#include "python_component.hpp"

#include <algorithm>
#include <cstring>
#include <new>
#include <stdexcept>
#include <utility>

namespace rtcf::python {

namespace {

constexpr std::align_val_t kCacheLine{64};

/// What compiled code gives for a raise: constant bytes that tell what and where.
struct Raised {
    const char* bytes;
    std::int32_t size;
};

/// FNV-1a of 64 bits.
std::uint64_t hashOf(const Raised& raised) noexcept {
    return detail::stateHash(std::string_view(raised.bytes, static_cast<std::size_t>(raised.size)));
}

template <typename T>
std::size_t countOf(const T* first, std::int64_t count, bool (*which)(const T&)) {
    return static_cast<std::size_t>(std::count_if(first, first + count, which));
}

bool isQueue(const InputTable& input) { return input.queue != nullptr; }
bool isMessageInput(const InputTable& input) { return input.message != nullptr; }
bool isMessageOutput(const OutputTable& output) { return output.message != nullptr; }

}  // namespace

PythonComponent::Record::Record(const ComponentTable& table) {
    const auto size = static_cast<std::size_t>(table.record_size);
    bytes_.reset(static_cast<std::byte*>(::operator new(size, kCacheLine)));
    std::memcpy(bytes_.get(), table.record, size);
}

void PythonComponent::Record::Free::operator()(std::byte* bytes) const noexcept {
    ::operator delete(bytes, kCacheLine);
}

PythonComponent::PythonComponent(const ComponentTable& table)
    : table_(table), update_(table.update), record_(table), times_(table.times) {
    record_.head().component = this;
    if (table.prepare != nullptr) {
        proposed_ = std::make_unique<Record>(table);
        proposed_->head().component = this;
    }
    reserve();
    declare();
}

void PythonComponent::reserve() {
    const std::size_t queues = countOf(table_.inputs, table_.input_count, &isQueue);
    const std::size_t message_inputs = countOf(table_.inputs, table_.input_count, &isMessageInput);
    const std::size_t message_outputs =
        countOf(table_.outputs, table_.output_count, &isMessageOutput);
    queues_.reserve(queues);
    message_inputs_.reserve(message_inputs);
    inputs_.reserve(static_cast<std::size_t>(table_.input_count) - queues - message_inputs);
    message_outputs_.reserve(message_outputs);
    outputs_.reserve(static_cast<std::size_t>(table_.output_count) - message_outputs);
    has_other_inputs_ = queues + message_inputs > 0;
    has_other_outputs_ = message_outputs > 0;
    parameters_.reserve(static_cast<std::size_t>(table_.parameter_count));
    derived_.reserve(static_cast<std::size_t>(table_.derived_count));
}

void PythonComponent::declare() {
    std::byte* const record = record_.bytes();
    for (std::int64_t i = 0; i < table_.input_count; ++i) {
        const InputTable& input = table_.inputs[i];
        if (isQueue(input)) {
            queues_.add(this, input, record);
        } else if (isMessageInput(input)) {
            message_inputs_.add(this, input, record);
        } else {
            inputs_.add(this, input, record);
        }
    }
    for (std::int64_t i = 0; i < table_.output_count; ++i) {
        const OutputTable& output = table_.outputs[i];
        if (isMessageOutput(output)) {
            message_outputs_.add(this, output, record);
        } else {
            outputs_.add(this, output, record);
        }
    }
    for (std::int64_t i = 0; i < table_.parameter_count; ++i)
        parameters_.add(this, table_.parameters[i], record);
    for (std::int64_t i = 0; i < table_.derived_count; ++i)
        derived_.add(this, table_.derived[i], record);
    for (std::int64_t i = 0; i < table_.state_count; ++i) {
        const StateTable& state = table_.states[i];
        StateDeclaration declaration = stateOf(*state.type);
        declaration.name = state.name;
        declaration.unit = state.unit;
        declaration.doc = state.doc;
        declaration.value = record + state.offset;
        declaration.initial.resize(declaration.size);
        std::memcpy(declaration.initial.data(), declaration.value, declaration.size);
        Component::declare(std::move(declaration));
    }
}

bool PythonComponent::prepare(const Values& /*proposed*/) {
    if (proposed_ == nullptr) return true;
    for (const ParameterField& parameter : parameters_) parameter.propose(proposed_->bytes());
    const void* const raised = table_.prepare(proposed_->bytes());
    if (raised != nullptr) return fail("{}", said(raised, proposed_->head().line));
    for (DerivedField& each : derived_) each.stage(proposed_->bytes());
    return true;
}

bool PythonComponent::start() {
    if (table_.start == nullptr) return true;
    takeTime();
    const void* const raised = table_.start(record_.bytes());
    forgetWrites();  // a cycle alone writes
    return raised == nullptr || fail("{}", said(raised, record_.head().line));
}

void PythonComponent::update() {
    readPorts();
    const void* const raised = update_(record_.bytes());
    if (__builtin_expect(static_cast<long>(raised != nullptr), 0) != 0) {
        forgetWrites();
        throw std::runtime_error(said(raised, record_.head().line));
    }
    writePorts();
}

void PythonComponent::safe() noexcept {
    if (table_.safe == nullptr) return;
    readPorts();
    if (table_.safe(record_.bytes()) != nullptr) {
        RTCF_ERROR(this, "safe() in {} raised at line {}", table_.file, record_.head().line);
    }
    writePorts();
}

// These are in line, what few components have is not: a cycle takes as long as the rest.

inline void PythonComponent::takeTime() noexcept {
    if (times_ == 0) return;
    if (times_ != kDt) takeTimes();
    if ((times_ & kDt) != 0) record_.head().dt = dt();
}

__attribute__((noinline)) void PythonComponent::takeTimes() noexcept {
    RecordHead& head = record_.head();
    if ((times_ & kTime) != 0) head.time = time();
    if ((times_ & kStamp) != 0) head.stamp = stamp();
    if ((times_ & kPeriod) != 0) head.period = period();
    if ((times_ & kIteration) != 0) head.iteration = static_cast<std::int64_t>(iteration());
    if ((times_ & kFrequency) != 0) head.frequency = frequency();
}

inline void PythonComponent::readPorts() noexcept {
    takeTime();
    for (ValueInput& input : inputs_) input.read();
    if (has_other_inputs_) readOthers();
}

__attribute__((noinline)) void PythonComponent::readOthers() noexcept {
    for (MessageInput& input : message_inputs_) input.read();
    for (QueuePort& queue : queues_) queue.read();
}

inline void PythonComponent::writePorts() noexcept {
    for (ValueOutput& output : outputs_) output.write();
    if (has_other_outputs_) writeOthers();
}

__attribute__((noinline)) void PythonComponent::writeOthers() noexcept {
    for (MessageOutput& output : message_outputs_) output.write();
}

void PythonComponent::forgetWrites() noexcept {
    for (ValueOutput& output : outputs_) output.forget();
    for (MessageOutput& output : message_outputs_) output.forget();
}

/// "my.py:12: `x = 1 / y`: ZeroDivisionError: division by zero". Not real-time safe: the loop ends.
std::string PythonComponent::said(const void* raised, std::int64_t noted) const {
    Raised what{};
    std::memcpy(&what, raised, sizeof what);
    const std::uint64_t hash = hashOf(what);
    const char* text = "raised an unknown exception";
    std::int64_t line = noted;
    for (std::int64_t i = 0; i < table_.raise_count; ++i) {
        const RaiseTable& each = table_.raises[i];
        if (each.hash != hash) continue;
        text = each.text;
        if (each.line != 0) line = each.line;
    }
    for (std::int64_t i = 0; i < table_.line_count; ++i) {
        const LineTable& each = table_.lines[i];
        if (each.line == line)
            return fmt::format("{}:{}: `{}`: {}", table_.file, line, each.text, text);
    }
    return fmt::format("{}:{}: {}", table_.file, line, text);
}

}  // namespace rtcf::python
