#include "messages/known_values.hpp"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>

#include <string>
#include <vector>

#include "common/error.hpp"

namespace rtcf::executor {

namespace {

using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

void requireKnown(const FieldDescriptor& field, int value) {
    const EnumDescriptor& type = *field.enum_type();
    if (type.FindValueByNumber(value) != nullptr) return;
    std::string known;
    for (int i = 0; i < type.value_count(); ++i) {
        if (type.value(i)->number() == 0) continue;
        known += (known.empty() ? "" : ", ") + type.value(i)->name();
    }
    throw Error(ErrorKind::InvalidArgument,
                fmt::format("{} {} is not known: choose of {}", field.name(), value, known));
}

}  // namespace

void requireKnownValues(const Message& message) {
    const Reflection& reflection = *message.GetReflection();
    std::vector<const FieldDescriptor*> fields;
    reflection.ListFields(message, &fields);
    for (const FieldDescriptor* field : fields) {
        const bool repeated = field->is_repeated();
        const int count = repeated ? reflection.FieldSize(message, field) : 1;
        if (field->cpp_type() == FieldDescriptor::CPPTYPE_ENUM) {
            for (int i = 0; i < count; ++i) {
                requireKnown(*field, repeated ? reflection.GetRepeatedEnumValue(message, field, i)
                                              : reflection.GetEnumValue(message, field));
            }
        } else if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
            for (int i = 0; i < count; ++i) {
                requireKnownValues(repeated ? reflection.GetRepeatedMessage(message, field, i)
                                            : reflection.GetMessage(message, field));
            }
        }
    }
}

}  // namespace rtcf::executor
