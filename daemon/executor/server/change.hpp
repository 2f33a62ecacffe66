/// @file
/// What a request changes.
#pragma once

#include <atomic>

#include "rtcf/executor/v1/executor.pb.h"
#include "runner/runner.hpp"

namespace rtcf::executor {

/// Carries out a request that changes the graph or the loop. Graph thread.
/// @param given_up of a step, which then pauses at the next boundary
/// @throws Refusal, also on a request that is none of these
ChangeOutcome change(Runner& runner, const v1::Request& request, const Runner::Progress& progress,
                     const std::atomic<bool>& given_up);

}  // namespace rtcf::executor
