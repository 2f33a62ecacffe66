/// @file
/// Access of components' hooks to the bridge.
#pragma once

#include <string>

#include "rtcf/node_gate.hpp"

namespace rtcf::executor {

/// Knows the hook that runs: it grants access to that hook only, names it in logs, and reports
/// calls that failed under it. Implemented by the bridge; graph thread only.
class HookGate : public NodeGate {
   public:
    /// Begins a hook of a component.
    /// @param component full name; lives until leave()
    virtual void enter(const std::string& component) noexcept = 0;
    /// Ends the hook.
    /// @return a call of the hook that got no answer from outside, in one line; empty = none
    virtual std::string leave() noexcept = 0;

   protected:
    ~HookGate() = default;
};

}  // namespace rtcf::executor
