/// @file
/// Makes components: opens their libraries, constructs and configures them, beside the running
/// loop. Owned by the runner; graph thread.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>

#include "faults/flight_recorder.hpp"
#include "graph/definition.hpp"
#include "graph/instance.hpp"
#include "logging/log.hpp"
#include "loop/loop.hpp"
#include "plugins/library.hpp"
#include "runner/bridge_link.hpp"
#include "runner/change_outcome.hpp"
#include "runner/loop_control.hpp"

namespace rtcf::executor {

class ComponentLoader {
   public:
    /// @param runner name of the runner, for log records and messages
    /// All references outlive this object.
    ComponentLoader(std::string runner, const Loop& loop, LoopControl& control,
                    const BridgeLink& bridge, Log& log, FlightRecorder& recorder);

    /// Trusts libraries of this user from here on.
    void trust(uid_t owner) { libraries_.trust(owner); }

    /// Makes a component.
    /// @param library   file
    /// @param configure false = only constructs it, to look at its ports
    /// @throws Error and others
    std::shared_ptr<Instance> make(ComponentDefinition definition, const std::string& library,
                                   const Progress& progress, bool configure = true);

   private:
    void requireThreadLocals(const Library& library);

    const std::string runner_;
    const Loop& loop_;
    LoopControl& control_;
    const BridgeLink& bridge_;
    Log& log_;
    FlightRecorder& recorder_;
    LibraryStore libraries_;
};

}  // namespace rtcf::executor
