#include "python_component.hpp"

#include <algorithm>
#include <cstring>
#include <new>
#include <stdexcept>
#include <utility>

namespace rtcf::python {

namespace {

constexpr std::size_t kCacheLine = 64;

/// Result of a hook that raises: constant bytes that identify the exception and its line.
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

PythonComponent::Record::Record(const ComponentTable& table)
    : Record(table, static_cast<std::size_t>(table.record_size), detail::constructionMemory()) {}

PythonComponent::Record::Record(const ComponentTable& table, std::size_t size,
                                ComponentMemory* memory)
    : bytes_(static_cast<std::byte*>(detail::allocateFrom(memory, size, kCacheLine)),
             Free{memory, size}) {
    std::memcpy(bytes_.get(), table.record, size);
}

void PythonComponent::Record::Free::operator()(std::byte* bytes) const noexcept {
    detail::releaseTo(memory, bytes, size, kCacheLine);
}

PythonComponent::PythonComponent(const ComponentTable& table)
    : table_(table), update_(table.update), record_(table) {
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
    ports_ = std::make_unique<void*[]>(
        static_cast<std::size_t>(table_.input_count) - queues - message_inputs +
        static_cast<std::size_t>(table_.output_count) - message_outputs);
    takes_dt_ = (table_.times & kDt) != 0;
    has_more_ = (table_.times & ~std::uint64_t{kDt}) != 0 || queues + message_inputs > 0;
    has_other_outputs_ = message_outputs > 0;
    parameters_.reserve(static_cast<std::size_t>(table_.parameter_count));
    derived_.reserve(static_cast<std::size_t>(table_.derived_count));
}

void PythonComponent::declare() {
    std::byte* const record = record_.bytes();
    void** port = ports_.get();
    for (std::int64_t i = 0; i < table_.input_count; ++i) {
        const InputTable& input = table_.inputs[i];
        if (isQueue(input)) {
            queues_.add(this, input, record);
        } else if (isMessageInput(input)) {
            message_inputs_.add(this, input, record);
        } else {
            *port++ = &inputs_.add(this, input);
        }
    }
    for (std::int64_t i = 0; i < table_.output_count; ++i) {
        const OutputTable& output = table_.outputs[i];
        if (isMessageOutput(output)) {
            message_outputs_.add(this, output, record);
        } else {
            *port++ = &outputs_.add(this, output, record);
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
        declaration.live = state.live != 0;
        declaration.value = record + state.offset;
        declaration.initial.resize(declaration.size);
        std::memcpy(declaration.initial.data(), declaration.value, declaration.size);
        accessTo(*this).declare(std::move(declaration));
    }
}

bool PythonComponent::prepare(const Values& /*proposed*/) {
    if (proposed_ == nullptr) return true;
    for (const ParameterField& parameter : parameters_) parameter.propose(proposed_->bytes());
    const void* const raised = table_.prepare(proposed_->bytes());
    if (raised != nullptr) return fail("{}", said(raised, *proposed_));
    for (DerivedField& each : derived_) each.stage(proposed_->bytes());
    return true;
}

bool PythonComponent::start() {
    if (table_.start == nullptr) return true;
    takeDt();
    takeTimes();
    const void* const raised = table_.start(record_.bytes());
    forgetWrites();  // only hooks of the cycle may write outputs
    return raised == nullptr || fail("{}", said(raised, record_));
}

// Rare work is not inlined, to keep the code of a usual cycle small.

void PythonComponent::update() {
    takeDt();
    if (has_more_) readMore();
    const void* const raised = update_(record_.bytes(), ports_.get());
    if (__builtin_expect(static_cast<long>(raised != nullptr), 0) != 0) fault(raised);
    if (has_other_outputs_) writeOthers();
}

void PythonComponent::safe() noexcept {
    if (table_.safe == nullptr) return;
    takeDt();
    if (has_more_) readMore();
    if (table_.safe(record_.bytes(), ports_.get()) != nullptr) {
        RTCF_ERROR(this, "safe() in {} raised at line {}", table_.file, record_.head().line);
    }
    if (has_other_outputs_) writeOthers();
}

inline void PythonComponent::takeDt() noexcept {
    if (takes_dt_) record_.head().dt = dt();
}

__attribute__((noinline)) void PythonComponent::readMore() noexcept {
    takeTimes();
    for (MessageInput& input : message_inputs_) input.read();
    for (QueuePort& queue : queues_) queue.read();
}

void PythonComponent::takeTimes() noexcept {
    RecordHead& head = record_.head();
    if ((table_.times & kTime) != 0) head.time = time();
    if ((table_.times & kStamp) != 0) head.stamp = stamp();
    if ((table_.times & kPeriod) != 0) head.period = period();
    if ((table_.times & kIteration) != 0) head.iteration = static_cast<std::int64_t>(iteration());
    if ((table_.times & kFrequency) != 0) head.frequency = frequency();
}

__attribute__((noinline)) void PythonComponent::writeOthers() noexcept {
    for (MessageOutput& output : message_outputs_) output.write();
}

__attribute__((noinline, cold)) void PythonComponent::fault(const void* raised) {
    forgetWrites();
    throw std::runtime_error(said(raised, record_));
}

void PythonComponent::forgetWrites() noexcept {
    for (ValueOutput& output : outputs_) output.forget();
    for (MessageOutput& output : message_outputs_) output.forget();
}

/// Formats an exception: "my.py:12: `x = 1 / y`: ZeroDivisionError: division by zero". Not
/// real-time safe: called outside the cycle, or after a fault.
std::string PythonComponent::said(const void* raised, Record& record) const {
    Raised what{};
    std::memcpy(&what, raised, sizeof what);
    const std::uint64_t hash = hashOf(what);
    std::string text = "raised an unknown exception";
    std::int64_t line = record.head().line;
    RaisedValues values{};
    std::memcpy(&values, record.bytes() + table_.record_size - sizeof values, sizeof values);
    for (std::int64_t i = 0; i < table_.raise_count; ++i) {
        const RaiseTable& each = table_.raises[i];
        if (each.hash != hash) continue;
        text = each.has_values == 0
                   ? each.text
                   : fmt::format(fmt::runtime(each.text), values.first, values.second);
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
