#include "ros/reconfigure/reconfigure_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace rtcf::ros1 {

namespace {

using executor::ParameterSet;
using executor::ParameterSnapshot;

// The whole is one group, as of a .cfg file without groups.
constexpr const char* kGroup = "Default";

std::int32_t narrowed(double value) {
    return static_cast<std::int32_t>(std::clamp<double>(
        value, std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max()));
}

void add(dynamic_reconfigure::Config& config, const std::string& name,
         const ParameterValue& value) {
    const auto put = [&name](auto& list, const auto& content) {
        list.emplace_back();
        list.back().name = name;
        list.back().value = content;
    };
    if (const auto* truth = std::get_if<bool>(&value)) {
        put(config.bools, static_cast<std::uint8_t>(*truth));
    } else if (const auto* integer = std::get_if<std::int64_t>(&value)) {
        put(config.ints, narrowed(static_cast<double>(*integer)));
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
    if (declaration.type == "int") {
        constexpr double kLowest = std::numeric_limits<std::int32_t>::min();
        constexpr double kHighest = std::numeric_limits<std::int32_t>::max();
        return std::int64_t{narrowed(declared.value_or(upper ? kHighest : kLowest))};
    }
    if (declaration.type == "double") {
        constexpr double kInfinity = std::numeric_limits<double>::infinity();
        return declared.value_or(upper ? kInfinity : -kInfinity);
    }
    return std::string();
}

// As Python literals, which is what its readers take it for.
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
    for (const ParameterSnapshot& parameter : set.parameters)
        add(config, parameter.declaration.name, parameter.value);
    addGroup(config);
    return config;
}

dynamic_reconfigure::ConfigDescription descriptionOf(const ParameterSet& set) {
    dynamic_reconfigure::ConfigDescription description;
    dynamic_reconfigure::Group group;
    group.name = kGroup;
    for (const ParameterSnapshot& parameter : set.parameters) {
        const ParameterDeclaration& declaration = parameter.declaration;
        dynamic_reconfigure::ParamDescription entry;
        entry.name = declaration.name;
        const bool is_text = declaration.type == "string" || declaration.type == "enum";
        entry.type = is_text ? "str" : declaration.type;
        entry.description = docOf(declaration);
        entry.edit_method = enumOf(declaration);
        group.parameters.push_back(entry);
        add(description.min, declaration.name, bound(declaration, false));
        add(description.max, declaration.name, bound(declaration, true));
        add(description.dflt, declaration.name, declaration.default_value);
    }
    description.groups.push_back(group);
    addGroup(description.min);
    addGroup(description.max);
    addGroup(description.dflt);
    return description;
}

executor::ParameterBatch batchOf(const dynamic_reconfigure::Config& asked,
                                 const ParameterSet& set) {
    executor::ParameterBatch batch;
    const auto take = [&](const std::string& name, const ParameterValue& value) {
        const auto same = [&](const ParameterSnapshot& parameter) {
            return parameter.declaration.name == name && parameter.value == value;
        };
        if (std::none_of(set.parameters.begin(), set.parameters.end(), same))
            batch.emplace_back(name, value);
    };
    for (const auto& each : asked.bools) take(each.name, each.value != 0);
    for (const auto& each : asked.ints) take(each.name, std::int64_t{each.value});
    for (const auto& each : asked.doubles) take(each.name, each.value);
    for (const auto& each : asked.strs) take(each.name, std::string(each.value));
    return batch;
}

}  // namespace rtcf::ros1
