#include "state/state_copy.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace rtcf::executor {

namespace {

const StateDeclaration* find(const Component& component, const std::string& name) {
    const auto& states = accessTo(component).states();
    const auto found = std::find_if(states.begin(), states.end(),
                                    [&](const auto& state) { return state.name == name; });
    return found == states.end() ? nullptr : &*found;
}

std::string joined(const std::vector<std::string>& names) {
    return fmt::format("{} {}", names.size() == 1 ? "state" : "states", fmt::join(names, ", "));
}

}  // namespace

std::size_t bytesOf(const std::vector<StateCopy>& copies) {
    std::size_t bytes = 0;
    for (const StateCopy& copy : copies) bytes += copy.size;
    return bytes;
}

void planHandOver(const Component& previous, const Component& successor,
                  std::vector<StateCopy>& copies, std::vector<std::string>& notes) {
    const std::string& name = successor.fullName();
    if (accessTo(previous).states().empty() && !accessTo(successor).states().empty())
        notes.push_back(name +
                        " begins at its initial state: the replaced component declares no state");
    std::vector<std::string> added;
    for (const StateDeclaration& state : accessTo(successor).states()) {
        const StateDeclaration* before = find(previous, state.name);
        if (before == nullptr) {
            if (accessTo(previous).states().empty()) continue;  // reported above
            added.push_back(state.name);
        } else if (before->identity != state.identity || before->size != state.size) {
            const std::string why =
                before->type == state.type
                    ? fmt::format("its type {} has changed", state.type)
                    : fmt::format("it was {} and is {}", before->type, state.type);
            notes.push_back(fmt::format("state {} of {} begins at {}: {}", state.name, name,
                                        state.print(state.initial.data()), why));
        } else {
            copies.push_back({state.value, before->value, state.size});
        }
    }
    if (!added.empty()) notes.push_back(fmt::format("new in {}: {}", name, joined(added)));
    std::vector<std::string> removed;
    for (const StateDeclaration& state : accessTo(previous).states()) {
        if (find(successor, state.name) == nullptr) removed.push_back(state.name);
    }
    if (!removed.empty()) notes.push_back(fmt::format("gone from {}: {}", name, joined(removed)));
}

std::vector<StateCopy> planReset(const Component& component, bool running) {
    std::vector<StateCopy> copies;
    for (const StateDeclaration& state : accessTo(component).states()) {
        if (!running || !state.live)
            copies.push_back({state.value, state.initial.data(), state.size});
    }
    return copies;
}

StateTexts::StateTexts(const Component& component) : declared_(accessTo(component).states()) {
    std::size_t size = 0;
    for (const StateDeclaration& state : declared_) size += state.size;
    bytes_.resize(size);
}

std::vector<StateCopy> StateTexts::copies() {
    std::vector<StateCopy> copies;
    std::byte* to = bytes_.data();
    for (const StateDeclaration& state : declared_) {
        copies.push_back({to, state.value, state.size});
        to += state.size;
    }
    return copies;
}

std::vector<std::string> StateTexts::texts() const {
    std::vector<std::string> texts;
    const std::byte* from = bytes_.data();
    for (const StateDeclaration& state : declared_) {
        texts.push_back(state.print(from));
        from += state.size;
    }
    return texts;
}

}  // namespace rtcf::executor
