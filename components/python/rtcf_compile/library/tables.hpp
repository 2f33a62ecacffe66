/// @file
/// The tables from which librtcf_python.a makes components: constants that rtcf-compile writes
/// beside the machine code of the hooks (tables.py, in the same order), and constants that an
/// adapter of a ROS message has (messages.py). All numbers have 64 bits, so that nothing lies
/// between the members.
///
/// A change of a table raises RTCF_PYTHON_TABLES, and TABLES in tables.py: a library then does not
/// link with the runtime of another release.
#pragma once

#include <rtcf/component.hpp>

#include <cstdint>
#include <memory>
#include <string>

namespace rtcf::python {

/// The type of an element; tables.py has the same numbers.
enum class Scalar : std::int64_t {
    Bool,
    Int8,
    Int16,
    Int32,
    Int64,
    UInt8,
    UInt16,
    UInt32,
    UInt64,
    Float,
    Double
};

/// The type of a port's value, or of a state. For arrays the functions are those of TypeInfo and
/// StateDeclaration, which get no context: small functions of the library itself, which call the
/// runtime's with their table. Null for a single number, whose functions the runtime has.
struct TypeTable {
    Scalar scalar;
    std::int64_t rows;     ///< 0: a single number
    std::int64_t columns;  ///< 1: a vector
    decltype(TypeInfo::make_slot) make_slot = nullptr;
    decltype(TypeInfo::copy) copy = nullptr;
    decltype(TypeInfo::exchange) exchange = nullptr;
    decltype(TypeInfo::length) length = nullptr;
    decltype(TypeInfo::serialize) serialize = nullptr;
    decltype(TypeInfo::deserialize) deserialize = nullptr;
    decltype(TypeInfo::print) print = nullptr;
    decltype(TypeInfo::finite) finite = nullptr;
    decltype(TypeInfo::sample) sample = nullptr;
    decltype(TypeInfo::copies) copies = nullptr;
    decltype(StateDeclaration::print) print_state = nullptr;
};

/// How a message has a field.
enum class Form : std::int64_t {
    Number,
    Array,     ///< of fixed size
    Sequence,  ///< a std::vector
    Time,      ///< two numbers of 32 bits, s and ns; Scalar tells whether the first has a sign
    Text,
    TextArray,
    TextSequence
};

/// One number, array or text of a message.
struct MessageField {
    Form form;
    Scalar scalar;
    std::int64_t offset;  ///< in the C++ message
    std::int64_t count;   ///< elements of an Array or a TextArray
};

/// What the adapter of a message type has: the type's own functions, and where its fields lie.
struct MessageTable {
    const TypeInfo& (*type)();
    const MessageField* fields;
};

/// A field of a message that hooks use.
struct LeafTable {
    std::int64_t field;    ///< index in MessageTable::fields
    std::int64_t offset;   ///< in the record
    std::int64_t count;    ///< where the record has the number of elements; -1: nowhere
    std::int64_t largest;  ///< elements that the record has room for
};

/// A constant text of a message that an output writes; several are a list.
struct TextTable {
    std::int64_t field;
    const char* const* texts;
    std::int64_t count;
};

/// An input that keeps each message; offsets are places in the record.
struct QueueTable {
    std::int64_t size;  ///< messages
    std::int64_t times;
    std::int64_t oldest;
    std::int64_t count;
    std::int64_t dropped;
};

/// An input; offsets are places in the record, -1 where no hook looks at it.
struct InputTable {
    const char* name;
    const TypeTable* type;        ///< null: a message
    const MessageTable* message;  ///< null: no message
    const QueueTable* queue;      ///< null: the newest value alone
    std::int64_t value;
    std::int64_t flags;  ///< bools: new, valid
    std::int64_t age;
    std::int64_t connected;
    const LeafTable* leaves;
    std::int64_t leaf_count;
    LogSite too_large;  ///< the warning about a message with more elements than declared
};

/// An output.
struct OutputTable {
    const char* name;
    const char* unit;
    const TypeTable* type;        ///< null: a message
    const MessageTable* message;  ///< null: no message
    std::int64_t finite;          ///< 1: declared Finite
    std::int64_t written;         ///< in the record, a bool
    const LeafTable* leaves;
    std::int64_t leaf_count;
    const TextTable* texts;
    std::int64_t text_count;
};

/// An enumerator of an enum parameter.
struct ChoiceTable {
    const char* name;
    std::int64_t value;
};

/// A parameter, or an element of one that is an array.
struct ParameterTable {
    const char* name;
    const char* unit;
    const char* doc;
    Scalar scalar;
    std::int64_t offset;  ///< in the record
    std::int64_t has_minimum;
    std::int64_t has_maximum;
    double minimum;
    double maximum;
    const ChoiceTable* choices;  ///< of an enum, which is an Int64
    std::int64_t choice_count;   ///< 0: no enum
};

struct DerivedTable {
    std::int64_t offset;  ///< in the record
    std::int64_t size;    ///< bytes
};

struct StateTable {
    const char* name;
    const char* unit;
    const char* doc;
    const TypeTable* type;
    std::int64_t offset;  ///< in the record
};

/// What the bytes of a raise mean. Line 0: in a function called from the line that the hook noted.
struct RaiseTable {
    std::uint64_t hash;  ///< FNV-1a of 64 bits
    std::int64_t line;
    const char* text;
    std::int64_t has_values;  ///< 1: a text with two {}, for RaisedValues
};

/// A line of the Python source that may be the one that a hook noted.
struct LineTable {
    std::int64_t line;
    const char* text;
};

/// A log call: its site, and the types of its arguments (Bool, Int64 or Double).
struct LogTable {
    LogSite site;
    std::int64_t count;
    const Scalar* types;
};

/// A hook's machine code. @return null, or what it raised
using HookFunction = const void* (*)(void* record);
/// The same of a hook that has ports. `ports`: the inputs of values, and the outputs behind them,
/// in order of their declaration; it reads those and writes these.
using PortHookFunction = const void* (*)(void* record, void* const* ports);

/// Members of the record that every component has, at its beginning.
struct RecordHead {
    Component* component;
    std::int64_t time;
    std::int64_t stamp;
    std::int64_t period;
    std::int64_t iteration;
    double dt;
    double frequency;
    std::int64_t line;  ///< that a hook noted last
};

/// The last member of the record: the numbers that an exception names, as index and size.
struct RaisedValues {
    std::int64_t first;
    std::int64_t second;
};

/// Which of the record's times hooks look at; bits of ComponentTable::times.
enum TimeBit : std::uint64_t {
    kTime = 1,
    kStamp = 2,
    kPeriod = 4,
    kIteration = 8,
    kDt = 16,
    kFrequency = 32
};

/// A component class.
struct ComponentTable {
    const char* name;
    const char* doc;
    const char* file;  ///< for messages
    Component* (*create)(const char* name, ComponentContext* context);
    const void* record;  ///< a new one
    std::int64_t record_size;
    HookFunction prepare;  ///< null: the class has none
    HookFunction start;    ///< likewise
    PortHookFunction update;
    PortHookFunction safe;  ///< null: the class has none
    std::uint64_t times;
    const InputTable* inputs;
    std::int64_t input_count;
    const OutputTable* outputs;
    std::int64_t output_count;
    const ParameterTable* parameters;
    std::int64_t parameter_count;
    const DerivedTable* derived;
    std::int64_t derived_count;
    const StateTable* states;
    std::int64_t state_count;
    const RaiseTable* raises;
    std::int64_t raise_count;
    const LineTable* lines;
    std::int64_t line_count;
};

/// The component classes of a library.
struct LibraryTable {
    const ComponentTable* const* components;
    std::int64_t count;
};

/// What the name ends in by which the runtime finds a library's tables.
#define RTCF_PYTHON_TABLES 2

}  // namespace rtcf::python
