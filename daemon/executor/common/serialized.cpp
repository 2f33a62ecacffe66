#include "common/serialized.hpp"

#include <google/protobuf/descriptor.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/utf8.hpp"

namespace rtcf::executor {

namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

std::vector<const FieldDescriptor*> setFields(const Message& message) {
    std::vector<const FieldDescriptor*> fields;
    message.GetReflection()->ListFields(message, &fields);
    return fields;
}

// Number of values of a set field.
int valuesOf(const Message& message, const FieldDescriptor* field) {
    return field->is_repeated() ? message.GetReflection()->FieldSize(message, field) : 1;
}

const std::string& textAt(const Message& message, const FieldDescriptor* field, int i,
                          std::string& memory) {
    const Reflection& reflection = *message.GetReflection();
    return field->is_repeated() ? reflection.GetRepeatedStringReference(message, field, i, &memory)
                                : reflection.GetStringReference(message, field, &memory);
}

// NOLINTBEGIN(misc-no-recursion): as deep as the protocol's messages

bool textsAreValid(const Message& message) {
    const Reflection& reflection = *message.GetReflection();
    std::string memory;
    for (const FieldDescriptor* field : setFields(message)) {
        const bool text = field->type() == FieldDescriptor::TYPE_STRING;
        if (!text && field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) continue;
        for (int i = 0; i < valuesOf(message, field); ++i) {
            const bool valid =
                text ? isUtf8(textAt(message, field, i, memory))
                     : textsAreValid(field->is_repeated()
                                         ? reflection.GetRepeatedMessage(message, field, i)
                                         : reflection.GetMessage(message, field));
            if (!valid) return false;
        }
    }
    return true;
}

void replaceInvalidTexts(Message& message) {
    const Reflection& reflection = *message.GetReflection();
    std::string memory;
    for (const FieldDescriptor* field : setFields(message)) {
        const bool repeated = field->is_repeated();
        const bool text = field->type() == FieldDescriptor::TYPE_STRING;
        if (!text && field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) continue;
        for (int i = 0; i < valuesOf(message, field); ++i) {
            if (!text) {
                replaceInvalidTexts(repeated
                                        ? *reflection.MutableRepeatedMessage(&message, field, i)
                                        : *reflection.MutableMessage(&message, field));
                continue;
            }
            std::string valid = validUtf8(textAt(message, field, i, memory));
            if (repeated) {
                reflection.SetRepeatedString(&message, field, i, std::move(valid));
            } else {
                reflection.SetString(&message, field, std::move(valid));
            }
        }
    }
}

// NOLINTEND(misc-no-recursion)

}  // namespace

std::string serialized(const Message& message) {
    if (textsAreValid(message)) return message.SerializeAsString();
    const std::unique_ptr<Message> copy(message.New());
    copy->CopyFrom(message);
    replaceInvalidTexts(*copy);
    return copy->SerializeAsString();
}

}  // namespace rtcf::executor
