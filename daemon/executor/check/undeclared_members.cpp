#include "check/undeclared_members.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace rtcf::executor {

namespace {

constexpr std::size_t kWord = 8;  // granularity, as a number rarely changes in all its bytes

}  // namespace

UndeclaredMembers::UndeclaredMembers(const Component& component) {
    const void* complete = dynamic_cast<const void*>(&component);  // the complete object
    object_ = static_cast<const std::byte*>(complete);
    const std::size_t size = accessTo(component).context().object_size;
    before_.assign(object_, object_ + size);
    changed_.resize(size);
    add(&component, sizeof component, "the base class", true);
    for (const InputPort* input : accessTo(component).inputs())
        add(&input->input(), sizeof(InputBase), "input " + input->name(), true);
    for (const OutputPort* output : accessTo(component).outputs())
        add(&output->output(), sizeof(OutputBase), "output " + output->name(), true);
    for (const ParameterBase* parameter : accessTo(component).parameters())
        add(parameter->place(), 0, "parameter " + parameter->declaration().name, false);
    for (const StateDeclaration& state : accessTo(component).states())
        add(state.value, state.size, "state " + state.name, true);
    std::sort(fields_.begin(), fields_.end(),
              [](const Field& a, const Field& b) { return a.begin < b.begin; });
}

void UndeclaredMembers::add(const void* begin, std::size_t size, std::string name,
                            bool may_change) {
    if (begin == nullptr) return;
    const auto offset = static_cast<const std::byte*>(begin) - object_;
    // A port may be outside the object, if the component holds it by pointer.
    if (offset < 0 || static_cast<std::size_t>(offset) >= before_.size()) return;
    const auto at = static_cast<std::size_t>(offset);
    fields_.push_back({at, at + size, std::move(name), may_change});
}

void UndeclaredMembers::look() {
    for (std::size_t i = 0; i < before_.size(); ++i) {
        if (before_[i] == object_[i]) continue;
        changed_[i] = true;
        before_[i] = object_[i];
    }
}

std::vector<std::string> UndeclaredMembers::found() const {
    std::vector<bool> changed = changed_;
    for (const Field& field : fields_) {
        if (!field.may_change) continue;
        for (std::size_t i = field.begin; i < std::min(field.end, changed.size()); ++i)
            changed[i] = false;
    }
    const auto word_changes = [&](std::size_t word) {
        const auto begin = changed.begin() + static_cast<std::ptrdiff_t>(word);
        return std::find(begin, begin + kWord, true) != begin + kWord;
    };
    std::vector<std::string> lines;
    changed.resize((changed.size() + kWord - 1) / kWord * kWord);
    for (std::size_t word = 0; word < changed.size(); word += kWord) {
        if (!word_changes(word)) continue;
        const std::size_t begin = word;
        const auto next = std::find_if(fields_.begin(), fields_.end(),
                                       [&](const Field& field) { return field.begin > begin; });
        const std::size_t end = next == fields_.end() ? changed.size() : next->begin;
        while (word + kWord < end && word_changes(word + kWord)) word += kWord;
        std::string place = next == fields_.begin() ? "" : ", after " + std::prev(next)->name;
        lines.push_back(fmt::format("{} bytes at offset {}{}", word + kWord - begin, begin, place));
    }
    return lines;
}

}  // namespace rtcf::executor
