/// @file
/// Functions of a library of components in Python, and its list of types, which comes from the
/// tables that rtcf-compile writes.
#include <fmt/args.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "python_component.hpp"

#define RTCF_PYTHON_JOINED_(name, number) name##number
#define RTCF_PYTHON_NAME_(name, number) RTCF_PYTHON_JOINED_(name, number)
/// The library's tables; the symbol contains the version of their format.
#define RTCF_PYTHON_LIBRARY RTCF_PYTHON_NAME_(rtcf_python_library_, RTCF_PYTHON_TABLES)

extern "C" {
extern const rtcf::python::LibraryTable RTCF_PYTHON_LIBRARY;
rtcf::Component* rtcf_python_create(const rtcf::python::ComponentTable* table,
                                    rtcf::ComponentContext* context);
void rtcf_python_log(const rtcf::python::LogTable* table, rtcf::Component* component,
                     const std::int64_t* values) noexcept;
void rtcf_python_read_more(const rtcf::python::ValueInput* input, std::int64_t* age,
                           bool* connected) noexcept;
}

namespace rtcf::python {

namespace {

std::vector<ComponentRecord> recordsOf(const LibraryTable& library) {
    std::vector<ComponentRecord> records;
    for (std::int64_t i = 0; i < library.count; ++i) {
        const ComponentTable& table = *library.components[i];
        records.push_back({table.name, table.doc, table.create, nullptr});
    }
    return records;
}

/// Registers the types of this library in the list that its entry point returns.
class Types {
   public:
    Types() : records_(recordsOf(RTCF_PYTHON_LIBRARY)) {
        for (ComponentRecord& record : records_) const detail::Registration registered(record);
    }

   private:
    std::vector<ComponentRecord> records_;
};
const Types types;

/// Formats the text of a log call. Not real-time safe.
void renderCall(const LogRecord& record, std::string& text) {
    const auto& table = *reinterpret_cast<const LogTable*>(record.site);
    fmt::dynamic_format_arg_store<fmt::format_context> arguments;
    for (std::int64_t i = 0; i < table.count; ++i) {
        const std::byte* const value =
            record.payload.data() + static_cast<std::size_t>(i) * sizeof(std::int64_t);
        std::int64_t whole = 0;
        double real = 0.0;
        std::memcpy(&whole, value, sizeof whole);
        std::memcpy(&real, value, sizeof real);
        switch (table.types[i]) {
            case Scalar::Bool:
                arguments.push_back(whole != 0);
                break;
            case Scalar::Double:
                arguments.push_back(real);
                break;
            default:
                arguments.push_back(whole);
                break;
        }
    }
    text = fmt::vformat(table.site.format, arguments);
}

}  // namespace

}  // namespace rtcf::python

rtcf::Component* rtcf_python_create(const rtcf::python::ComponentTable* table,
                                    rtcf::ComponentContext* context) {
    return rtcf::detail::construct<rtcf::python::PythonComponent>(context, *table);
}

/// Stores a log record; each value has 64 bits. Real-time safe.
void rtcf_python_log(const rtcf::python::LogTable* table, rtcf::Component* component,
                     const std::int64_t* values) noexcept {
    if (!component->logs(table->site.level)) return;
    rtcf::LogRecord* const record = component->logSink().claim();
    if (record == nullptr) return;
    record->site = &table->site;
    record->component = component->fullName().c_str();
    record->render = &rtcf::python::renderCall;
    std::memcpy(record->payload.data(), values,
                static_cast<std::size_t>(table->count) * sizeof *values);
    component->logSink().commit(record);
}

/// Stores the age and the connection of an input; null: no hook uses it. Real-time safe.
void rtcf_python_read_more(const rtcf::python::ValueInput* input, std::int64_t* age,
                           bool* connected) noexcept {
    if (age != nullptr) *age = input->age();
    if (connected != nullptr) *connected = input->connected();
}
