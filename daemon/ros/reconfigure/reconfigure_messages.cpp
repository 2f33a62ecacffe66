#include "ros/reconfigure/reconfigure_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

namespace rtcf::ros1 {

namespace {

using executor::ParameterSet;
using executor::ParameterView;

// All parameters are in one group, as with a .cfg file without groups.
constexpr const char* kGroup = "Default";

constexpr double kLowest = std::numeric_limits<std::int32_t>::min();
constexpr double kHighest = std::numeric_limits<std::int32_t>::max();

std::int32_t narrowed(double value) {
    return static_cast<std::int32_t>(std::clamp(value, kLowest, kHighest));
}

// Integers of dynamic_reconfigure have 32 bits. An integer whose bounds are wider is sent as a
// double, which is exact up to 2^53.
bool isWide(const ParameterDeclaration& declaration) {
    const auto* normal = std::get_if<std::int64_t>(&declaration.default_value);
    if (normal == nullptr) return false;
    const auto beyond = [](double value) { return value < kLowest || value > kHighest; };
    return !declaration.minimum || !declaration.maximum || beyond(static_cast<double>(*normal)) ||
           beyond(*declaration.minimum) || beyond(*declaration.maximum);
}

std::string typeOf(const ParameterDeclaration& declaration) {
    if (declaration.type == "string" || declaration.type == "enum") return "str";
    return isWide(declaration) ? "double" : declaration.type;
}

void add(dynamic_reconfigure::Config& config, const ParameterDeclaration& declaration,
         const ParameterValue& value) {
    const std::string& name = declaration.name;
    const auto put = [&name](auto& list, const auto& content) {
        list.emplace_back();
        list.back().name = name;
        list.back().value = content;
    };
    if (const auto* truth = std::get_if<bool>(&value)) {
        put(config.bools, static_cast<std::uint8_t>(*truth));
    } else if (const auto* integer = std::get_if<std::int64_t>(&value)) {
        const auto number = static_cast<double>(*integer);
        if (isWide(declaration)) {
            put(config.doubles, number);
        } else {
            put(config.ints, narrowed(number));
        }
    } else if (const auto* real = std::get_if<double>(&value)) {
        put(config.doubles, *real);
    } else {
        put(config.strs, std::get<std::string>(value));
    }
}

void addGroup(dynamic_reconfigure::Config& config) {
    dynamic_reconfigure::GroupState group;
    group.name = kGroup;
    group.state = 1;
    config.groups.push_back(group);
}

ParameterValue bound(const ParameterDeclaration& declaration, bool upper) {
    const std::optional<double>& declared = upper ? declaration.maximum : declaration.minimum;
    if (declaration.type == "bool") return upper;
    if (typeOf(declaration) == "int") {
        return std::int64_t{narrowed(declared.value_or(upper ? kHighest : kLowest))};
    }
    if (typeOf(declaration) == "double") {
        constexpr double kInfinity = std::numeric_limits<double>::infinity();
        return declared.value_or(upper ? kInfinity : -kInfinity);
    }
    return std::string();
}

// Python literals, as readers of edit_method expect.
std::string quoted(const std::string& text) {
    std::string result = "'";
    for (const char c : text) {
        if (c == '\'' || c == '\\') result += '\\';
        result += c == '\n' ? ' ' : c;
    }
    return result + "'";
}

std::string enumOf(const ParameterDeclaration& declaration) {
    if (declaration.choices.empty()) return {};
    std::string choices;
    for (const Choice& choice : declaration.choices) {
        choices += fmt::format(
            "{}{{'name': {}, 'type': 'str', 'value': {}, 'description': '', 'srcline': 0, "
            "'srcfile': '', 'cconsttype': 'const char * const', 'ctype': 'std::string'}}",
            choices.empty() ? "" : ", ", quoted(choice.name), quoted(choice.name));
    }
    return fmt::format("{{'enum': [{}], 'enum_description': {}}}", choices,
                       quoted(declaration.doc));
}

std::string docOf(const ParameterDeclaration& declaration) {
    if (declaration.unit.empty()) return declaration.doc;
    return declaration.doc + (declaration.doc.empty() ? "[" : " [") + declaration.unit + "]";
}

}  // namespace

dynamic_reconfigure::Config valuesOf(const ParameterSet& set) {
    dynamic_reconfigure::Config config;
    for (const ParameterView& parameter : set.parameters)
        add(config, parameter.declaration, parameter.value);
    addGroup(config);
    return config;
}

dynamic_reconfigure::ConfigDescription descriptionOf(const ParameterSet& set) {
    dynamic_reconfigure::ConfigDescription description;
    dynamic_reconfigure::Group group;
    group.name = kGroup;
    for (const ParameterView& parameter : set.parameters) {
        const ParameterDeclaration& declaration = parameter.declaration;
        dynamic_reconfigure::ParamDescription entry;
        entry.name = declaration.name;
        entry.type = typeOf(declaration);
        entry.description = docOf(declaration);
        entry.edit_method = enumOf(declaration);
        group.parameters.push_back(entry);
        add(description.min, declaration, bound(declaration, false));
        add(description.max, declaration, bound(declaration, true));
        add(description.dflt, declaration, declaration.default_value);
    }
    description.groups.push_back(group);
    addGroup(description.min);
    addGroup(description.max);
    addGroup(description.dflt);
    return description;
}

executor::ParameterBatch batchOf(const dynamic_reconfigure::Config& asked,
                                 const ParameterSet& set) {
    // The values as peers see them, so that sending them back changes nothing.
    const dynamic_reconfigure::Config shown = valuesOf(set);
    executor::ParameterBatch batch;
    const auto take = [&](const auto& list, const auto& known, const auto& value_of) {
        for (const auto& each : list) {
            const auto same = [&each](const auto& other) {
                return other.name == each.name && other.value == each.value;
            };
            if (std::none_of(known.begin(), known.end(), same))
                batch.emplace_back(each.name, value_of(each));
        }
    };
    const auto isInteger = [&set](const std::string& name) {
        return std::any_of(
            set.parameters.begin(), set.parameters.end(), [&name](const ParameterView& parameter) {
                return parameter.declaration.name == name && parameter.declaration.type == "int";
            });
    };
    take(asked.bools, shown.bools,
         [](const auto& each) { return ParameterValue(each.value != 0); });
    take(asked.ints, shown.ints,
         [](const auto& each) { return ParameterValue(std::int64_t{each.value}); });
    take(asked.doubles, shown.doubles, [&](const auto& each) {
        constexpr double kExact = 9007199254740992.0;
        if (isInteger(each.name) && std::abs(each.value) <= kExact)
            return ParameterValue(std::int64_t{std::llround(each.value)});
        return ParameterValue(each.value);
    });
    take(asked.strs, shown.strs,
         [](const auto& each) { return ParameterValue(std::string(each.value)); });
    return batch;
}

std::vector<std::string> bringWithinBounds(executor::ParameterBatch& batch,
                                           const ParameterSet& set) {
    std::vector<std::string> lines;
    const auto clamped = [&](const ParameterDeclaration& declaration, auto& value) {
        using Number = std::decay_t<decltype(value)>;
        const auto number = static_cast<double>(value);
        const double low = declaration.minimum.value_or(number);
        const double high = declaration.maximum.value_or(number);
        if (!(number < low) && !(number > high)) return;  // NaN stays
        const Number asked = value;
        // The nearest integer within the bounds.
        const double nearest = number < low ? low : high;
        if constexpr (std::is_integral_v<Number>) {
            value = static_cast<Number>(number < low ? std::ceil(nearest) : std::floor(nearest));
        } else {
            value = nearest;
        }
        lines.push_back(fmt::format("{} = {} is {} its {} {}: it is set to {}", declaration.name,
                                    asked, number < low ? "below" : "above",
                                    number < low ? "minimum" : "maximum", nearest, value));
    };
    for (auto& [name, value] : batch) {
        const auto found = std::find_if(
            set.parameters.begin(), set.parameters.end(),
            [name = &name](const ParameterView& each) { return each.declaration.name == *name; });
        if (found == set.parameters.end()) continue;
        if (auto* integer = std::get_if<std::int64_t>(&value)) {
            if (found->declaration.type == "int") clamped(found->declaration, *integer);
        } else if (auto* real = std::get_if<double>(&value)) {
            if (found->declaration.type == "double") clamped(found->declaration, *real);
        }
    }
    return lines;
}

}  // namespace rtcf::ros1
