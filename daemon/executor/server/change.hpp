/// @file
/// What a request changes.
#pragma once

#include "rtcf/executor/v1/executor.pb.h"
#include "runner/runner.hpp"

namespace rtcf::executor {

/// Carries out a request that changes the graph or the loop. Graph thread.
/// @throws Refusal, also on a request that is none of these
ChangeOutcome change(Runner& runner, const v1::Request& request, const Runner::Progress& progress);

}  // namespace rtcf::executor
