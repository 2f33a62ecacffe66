/// @file
/// Conversion of declared parameters to and from messages of dynamic_reconfigure. Pure functions.
#pragma once

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/ConfigDescription.h>

#include <string>
#include <vector>

#include "bridge/bridge.hpp"

namespace rtcf::ros1 {

/// The parameters' values.
dynamic_reconfigure::Config valuesOf(const executor::ParameterSet& set);

/// Types, bounds, defaults, descriptions, and the enumerators of enums.
dynamic_reconfigure::ConfigDescription descriptionOf(const executor::ParameterSet& set);

/// The changes that `asked` requests, without values that are unchanged in the form of valuesOf().
executor::ParameterBatch batchOf(const dynamic_reconfigure::Config& asked,
                                 const executor::ParameterSet& set);

/// Clamps each number of the batch to its parameter's bounds.
/// @return a line for each clamped value
std::vector<std::string> bringWithinBounds(executor::ParameterBatch& batch,
                                           const executor::ParameterSet& set);

}  // namespace rtcf::ros1
