#include "graph/inherited_parameters.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <string_view>

namespace rtcf::executor {

namespace {

using Settings = std::vector<std::pair<std::string, ParameterValue>>;
constexpr std::string_view kSize = ParameterDeclaration::kSizeSuffix;
constexpr std::uint64_t kFixed = std::numeric_limits<std::uint64_t>::max();

bool isSize(std::string_view name) {
    return name.size() > kSize.size() && name.substr(name.size() - kSize.size()) == kSize;
}

// `taps_3` → `taps`, `gain_0_1` → `gain`, `taps_size` → `taps`; other names as they are.
std::string arrayOf(const std::string& name) {
    std::string_view rest = name;
    if (isSize(rest)) return std::string(rest.substr(0, rest.size() - kSize.size()));
    for (;;) {
        const std::size_t end = rest.find_last_not_of("0123456789");
        if (end == 0 || end == std::string_view::npos || end + 1 == rest.size() || rest[end] != '_')
            return std::string(rest);
        rest = rest.substr(0, end);
    }
}

bool isFirstElement(const std::string& name, const std::string& array) {
    return name.size() > array.size() &&
           name.find_first_not_of("_0", array.size()) == std::string::npos;
}

// The index of an element of a vector; nothing for its size and for an element of a matrix.
std::optional<std::uint64_t> indexOf(const std::string& name, const std::string& vector) {
    const std::string digits = name.substr(std::min(name.size(), vector.size() + 1));
    const bool number = !digits.empty() && digits.size() < 10 &&
                        digits.find_first_not_of("0123456789") == std::string::npos;
    return number ? std::optional<std::uint64_t>(std::stoull(digits)) : std::nullopt;
}

const ParameterValue* valueOf(const Settings& settings, const std::string& name) {
    for (const auto& [setting, value] : settings) {
        if (setting == name) return &value;
    }
    return nullptr;
}

class Keeper {
   public:
    Keeper(const std::vector<ParameterBase*>& declared, const Settings& given, std::string type)
        : declared_(declared), given_(given), type_(std::move(type)) {}

    // Keeps all of an array, or the only one of another parameter.
    void keep(const std::string& name, const std::vector<const InheritedParameter*>& members,
              bool array) {
        if (array && isGiven(name)) return;
        Settings valid;
        std::string why = array ? misfit(name, members) : std::string();
        const std::uint64_t size = array ? sizeOf(name, members) : kFixed;
        for (const InheritedParameter* member : members) {
            if (!why.empty()) break;
            if (valueOf(given_, member->name) != nullptr) continue;
            ParameterValue value = member->value;
            const std::string wrong = check(member->name, value);
            const auto index = indexOf(member->name, name);
            if (!wrong.empty()) {
                if (!index || *index < size) why = wrong;
                continue;
            }
            if (!sameValue(value, find(member->name)->declaration().default_value))
                valid.emplace_back(member->name, std::move(value));
        }
        if (why.empty()) {
            result.kept.insert(result.kept.end(), valid.begin(), valid.end());
            return;
        }
        const bool chosen = std::any_of(members.begin(), members.end(), [this](const auto* member) {
            return member->chosen && valueOf(given_, member->name) == nullptr;
        });
        if (!chosen) return;
        result.notes.push_back(fmt::format("parameter {} = {} is not kept: {}", name,
                                           text(members, size, array), why));
    }

    KeptParameters result;

   private:
    const ParameterBase* find(const std::string& name) const {
        const auto found = std::find_if(declared_.begin(), declared_.end(), [&](const auto* each) {
            return each->declaration().name == name;
        });
        return found == declared_.end() ? nullptr : *found;
    }

    // True if another value was chosen for each element of an array.
    bool isGiven(const std::string& array) const {
        bool found = false;
        for (const ParameterBase* parameter : declared_) {
            const std::string& name = parameter->declaration().name;
            if (name == array || arrayOf(name) != array) continue;
            if (valueOf(given_, name) == nullptr) return false;
            found = true;
        }
        return found;
    }

    std::string check(const std::string& name, ParameterValue& value) const {
        const ParameterBase* const parameter = find(name);
        return parameter != nullptr ? parameter->check(value)
                                    : fmt::format("{} has no such parameter", type_);
    }

    // The number of elements that a vector will have; kFixed for an array of fixed length.
    std::uint64_t sizeOf(const std::string& array,
                         const std::vector<const InheritedParameter*>& members) const {
        const std::string name = array + std::string(kSize);
        const ParameterValue* value = valueOf(given_, name);
        for (const InheritedParameter* member : members) {
            if (value == nullptr && member->name == name) value = &member->value;
        }
        const auto* const number = value != nullptr ? std::get_if<std::int64_t>(value) : nullptr;
        return number != nullptr && *number >= 0 ? static_cast<std::uint64_t>(*number) : kFixed;
    }

    // Why an array cannot be kept as a whole; empty = it may be.
    std::string misfit(const std::string& array,
                       const std::vector<const InheritedParameter*>& members) const {
        std::size_t elements = 0;
        bool has_size = false;
        for (const ParameterBase* parameter : declared_) {
            const std::string& name = parameter->declaration().name;
            if (arrayOf(name) != array || name == array) continue;
            if (parameter->declaration().is_size) {
                has_size = true;
            } else {
                ++elements;
            }
        }
        if (elements == 0) return fmt::format("{} has no such parameter", type_);
        const std::uint64_t size = sizeOf(array, members);
        if (has_size) {
            if (size == kFixed)
                return fmt::format("it is a vector of {} elements at most now", elements);
            return size <= elements ? std::string()
                                    : fmt::format("it has {} elements at most now", elements);
        }
        const bool same = size == kFixed && members.size() == elements;
        return same ? std::string() : fmt::format("it has {} elements now", elements);
    }

    static std::string text(const std::vector<const InheritedParameter*>& members,
                            std::uint64_t size, bool array) {
        if (!array) return parameterText(members[0]->value);
        std::string list;
        std::uint64_t count = 0;
        for (const InheritedParameter* member : members) {
            if (isSize(member->name)) continue;
            if (count == size) break;
            list += (count++ == 0 ? "" : ", ") + parameterText(member->value);
        }
        return "[" + list + "]";
    }

    const std::vector<ParameterBase*>& declared_;
    const Settings& given_;
    std::string type_;
};

}  // namespace

std::string parameterText(const ParameterValue& value) {
    return std::visit([](const auto& held) { return fmt::format("{}", held); }, value);
}

KeptParameters inheritedParameters(const std::vector<InheritedParameter>& inherited,
                                   const std::vector<ParameterBase*>& declared,
                                   const Settings& given, const std::string& type) {
    std::map<std::string, std::vector<const InheritedParameter*>> arrays;
    for (const InheritedParameter& each : inherited) {
        const std::string array = arrayOf(each.name);
        if (array != each.name) arrays[array].push_back(&each);
    }
    Keeper keeper(declared, given, type);
    std::vector<std::string> done;
    for (const InheritedParameter& each : inherited) {
        const std::string array = arrayOf(each.name);
        const auto& members = arrays[array];
        const auto is_first = [&](const InheritedParameter* member) {
            return isFirstElement(member->name, array);
        };
        if (array == each.name || std::none_of(members.begin(), members.end(), is_first)) {
            keeper.keep(each.name, {&each}, false);
        } else if (std::find(done.begin(), done.end(), array) == done.end()) {
            done.push_back(array);
            keeper.keep(array, members, true);
        }
    }
    return std::move(keeper.result);
}

}  // namespace rtcf::executor
