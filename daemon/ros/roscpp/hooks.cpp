#include "ros/roscpp/hooks.hpp"

#include <stdexcept>

#include "ros/calls/master_calls.hpp"

namespace rtcf::ros1 {

namespace {

thread_local const std::string* present = nullptr;

}  // namespace

const std::string* Hooks::component() noexcept { return present; }

void Hooks::pass() {
    if (present == nullptr) {
        throw std::logic_error(
            "nodeHandle() is for configure(), start(), stop() and cleanup() only");
    }
    await_node_();
}

void Hooks::enter(const std::string& component) noexcept {
    present = &component;
    MasterCalls::beginNote();
}

std::string Hooks::leave() noexcept {
    present = nullptr;
    return MasterCalls::endNote();
}

}  // namespace rtcf::ros1
