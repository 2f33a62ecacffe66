/// @file
/// The tables from which librtcf_python.a makes components. rtcf-compile writes them as constants
/// beside the machine code of the hooks (tables.py, same order of members); the adapters of ROS
/// messages contain the others (messages.py). All numbers have 64 bits, so that there is no padding
/// between members.
///
/// Increment RTCF_PYTHON_TABLES, and TABLES in tables.py, when a table changes: a library then does
/// not link with the runtime of another release.
#pragma once

#include <rtcf/component.hpp>

#include <cstdint>
#include <memory>
#include <string>

namespace rtcf::python {

/// The type of an element; tables.py uses the same numbers.
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

/// The type of a port's value or of a state. For an array, the function members are those of
/// TypeInfo and StateDeclaration. These take no context, so each library defines small functions
/// that call the runtime with their table. For a single number they are null: the runtime provides
/// its functions.
struct TypeTable {
    Scalar scalar;
    std::int64_t rows;       ///< 0: a single number
    std::int64_t columns;    ///< 1: a vector
    std::int64_t depth = 0;  ///< matrices of a state of three dimensions; 0: at most two
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

/// The representation of a field in a C++ message.
enum class Form : std::int64_t {
    Number,
    Array,     ///< of fixed size
    Sequence,  ///< a std::vector
    Time,      ///< two numbers of 32 bits, s and ns; Scalar gives the sign of the first
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

/// The adapter of a message type: the functions of the type and its fields.
struct MessageTable {
    const TypeInfo& (*type)();
    const MessageField* fields;
};

/// A field of a message that hooks use.
struct LeafTable {
    std::int64_t field;    ///< index in MessageTable::fields
    std::int64_t offset;   ///< in the record
    std::int64_t count;    ///< offset of the number of elements in the record; -1: none
    std::int64_t largest;  ///< capacity of the record, elements
};

/// A constant text of a message that an output writes, or a list of texts.
struct TextTable {
    std::int64_t field;
    const char* const* texts;
    std::int64_t count;
};

/// An input that queues messages; the other members are offsets in the record.
struct QueueTable {
    std::int64_t size;  ///< messages
    std::int64_t times;
    std::int64_t oldest;
    std::int64_t count;
    std::int64_t dropped;
};

/// An input; offsets in the record are -1 if no hook reads the field.
struct InputTable {
    const char* name;
    const char* unit;
    const char* doc;
    const TypeTable* type;        ///< null: a message
    const MessageTable* message;  ///< null: not a message
    const QueueTable* queue;      ///< null: only the newest value
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
    const char* doc;
    const TypeTable* type;        ///< null: a message
    const MessageTable* message;  ///< null: not a message
    std::int64_t finite;          ///< 1: declared Finite
    std::int64_t written;         ///< offset of a bool in the record
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

/// A parameter, or an element of an array parameter.
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
    const ChoiceTable* choices;  ///< enumerators of an enum, an Int64
    std::int64_t choice_count;   ///< 0: not an enum
    std::int64_t fixed;          ///< 1: see rtcf::Fixed
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
    std::int64_t live;    ///< 1: see rtcf::Live
};

/// The meaning of the bytes of an exception. Line 0: raised in a function that the hook called from
/// the line that it noted last.
struct RaiseTable {
    std::uint64_t hash;  ///< FNV-1a of 64 bits
    std::int64_t line;
    const char* text;
    std::int64_t has_values;  ///< 1: the text has two {} for RaisedValues
};

/// A line of the Python source that a hook may note.
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

/// The machine code of a hook. @return null, or the exception
using HookFunction = const void* (*)(void* record);
/// The machine code of a hook with ports. `ports`: the inputs of values, then the outputs, both in
/// order of declaration. The hook reads the inputs and writes the outputs.
using PortHookFunction = const void* (*)(void* record, void* const* ports);

/// The first members of the record of every component.
struct RecordHead {
    Component* component;
    std::int64_t time;
    std::int64_t stamp;
    std::int64_t period;
    std::int64_t iteration;
    double dt;
    double frequency;
    std::int64_t line;  ///< the line that a hook noted last
};

/// The last member of the record: the numbers in the text of an exception, such as index and size.
struct RaisedValues {
    std::int64_t first;
    std::int64_t second;
};

/// The times that hooks read; bits of ComponentTable::times.
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
    const void* record;  ///< initial content
    std::int64_t record_size;
    HookFunction prepare;  ///< null: the class has none
    HookFunction start;    ///< null: the class has none
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

/// The suffix of the symbol that points to the tables of a library.
#define RTCF_PYTHON_TABLES 5

}  // namespace rtcf::python
