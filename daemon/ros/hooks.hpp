/// @file
/// What components' hooks have to do with the node: their way in, and what
/// went wrong under them.
#pragma once

#include <string>

#include "bridge/hook_gate.hpp"

namespace rtcf::ros1 {

class MasterWatch;

/// Owned by the master watch; called by the thread that runs the hooks.
class Hooks final : public executor::HookGate {
   public:
    explicit Hooks(MasterWatch& watch) : watch_(watch) {}

    void pass() override;
    void enter(const std::string& component) noexcept override;
    std::string leave() noexcept override;

    /// Full name of the component whose hook the calling thread is in; null = none.
    static const std::string* component() noexcept;

   private:
    MasterWatch& watch_;
};

}  // namespace rtcf::ros1
