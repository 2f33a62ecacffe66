#include "graph/fitted_value.hpp"

#include <cmath>
#include <optional>
#include <string>

#include "graph/inherited_parameters.hpp"
#include "rtcf/read_number.hpp"

namespace rtcf::executor {

void fit(const ParameterDeclaration& declaration, ParameterValue& value) {
    constexpr double kExact = 9007199254740992.0;  // largest exact integer of a double
    const auto* const integer = std::get_if<std::int64_t>(&value);
    const auto* const real = std::get_if<double>(&value);
    const auto* const text = std::get_if<std::string>(&value);
    if (declaration.type == "double" && integer != nullptr) {
        value = static_cast<double>(*integer);
    } else if (declaration.type == "double" && text != nullptr) {
        const std::optional<double> number = readNumber(*text);
        if (number && std::isfinite(*number)) value = *number;
    } else if (declaration.type == "int" && real != nullptr) {
        if (std::abs(*real) <= kExact && std::trunc(*real) == *real)
            value = static_cast<std::int64_t>(*real);
    } else if (declaration.type == "bool" && integer != nullptr) {
        if (*integer == 0 || *integer == 1) value = *integer == 1;
    } else if (declaration.type == "string" && text == nullptr) {
        value = parameterText(value);
    }
}

}  // namespace rtcf::executor
