#include "messages/parameter_value.hpp"

#include <fmt/format.h>

#include "common/error.hpp"

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

ParameterValue parameterValueFrom(const pb::ParameterValue& value, const std::string& name) {
    switch (value.kind_case()) {
        case pb::ParameterValue::kBoolValue:
            return value.bool_value();
        case pb::ParameterValue::kIntValue:
            return static_cast<std::int64_t>(value.int_value());
        case pb::ParameterValue::kDoubleValue:
            return value.double_value();
        case pb::ParameterValue::kStringValue:
            return value.string_value();
        case pb::ParameterValue::KIND_NOT_SET:
            break;
    }
    throw Error(ErrorKind::InvalidArgument, fmt::format("parameter {} has no value", name));
}

pb::ParameterValue parameterValueTo(const ParameterValue& value) {
    pb::ParameterValue message;
    std::visit(
        [&](const auto& held) {
            using T = std::decay_t<decltype(held)>;
            if constexpr (std::is_same_v<T, bool>) {
                message.set_bool_value(held);
            } else if constexpr (std::is_same_v<T, std::int64_t>) {
                message.set_int_value(held);
            } else if constexpr (std::is_same_v<T, double>) {
                message.set_double_value(held);
            } else {
                message.set_string_value(held);
            }
        },
        value);
    return message;
}

}  // namespace rtcf::executor
