/// @file
/// What components' hooks may have to do with the link to the outside.
#pragma once

#include <string>

#include "rtcf/node_gate.hpp"

namespace rtcf::executor {

/// Knows which hook runs, so that it can let it through, name it in logs, and
/// tell what went wrong under it. Implemented by the bridge; graph thread only.
class HookGate : public NodeGate {
   public:
    /// A hook of this component begins. @param component full name; lives until leave()
    virtual void enter(const std::string& component) noexcept = 0;
    /// It has ended. @return what it asked of the outside and got no answer to, one line; empty =
    /// nothing
    virtual std::string leave() noexcept = 0;

   protected:
    ~HookGate() = default;
};

}  // namespace rtcf::executor
