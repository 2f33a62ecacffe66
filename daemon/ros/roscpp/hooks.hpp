/// @file
/// Access of components' hooks to the node, and the failures of their calls.
#pragma once

#include <functional>
#include <string>
#include <utility>

#include "graph/hook_gate.hpp"

namespace rtcf::ros1 {

/// Owned by the master watch; called by the thread that runs the hooks.
class Hooks final : public executor::HookGate {
   public:
    /// @param await_node waits until the node is up at a master that answers; throws
    ///                   NoMaster otherwise
    explicit Hooks(std::function<void()> await_node) : await_node_(std::move(await_node)) {}

    void pass() override;
    void enter(const std::string& component) noexcept override;
    std::string leave() noexcept override;

    /// Full name of the component whose hook the calling thread runs; null = none.
    static const std::string* component() noexcept;

   private:
    std::function<void()> await_node_;
};

}  // namespace rtcf::ros1
