/// @file
/// Requests that change the graph or the loop.
#pragma once

#include <atomic>

#include "rtcf/executor/v1/executor.pb.h"
#include "runner/runner.hpp"

namespace rtcf::executor {

/// Carries out a request that changes the graph or the loop. Graph thread.
/// @param given_up set by any thread to pause a step at the next boundary
/// @throws Error, also if the request is of another kind
ChangeOutcome change(Runner& runner, const v1::Request& request, const Progress& progress,
                     const std::atomic<bool>& given_up);

}  // namespace rtcf::executor
