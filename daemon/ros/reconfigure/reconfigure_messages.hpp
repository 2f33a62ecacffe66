/// @file
/// Declared parameters in the messages of dynamic_reconfigure. Pure functions.
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

/// What `asked` would change; values that are as they are already are left out, and so are those
/// that valuesOf() could not show as they are.
executor::ParameterBatch batchOf(const dynamic_reconfigure::Config& asked,
                                 const executor::ParameterSet& set);

/// Brings each number of the batch within its parameter's bounds, to the nearest that is.
/// @return a line for each that was not
std::vector<std::string> bringWithinBounds(executor::ParameterBatch& batch,
                                           const executor::ParameterSet& set);

}  // namespace rtcf::ros1
