/// @file
/// The parameters that a component keeps from the one that it replaces.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "graph/definition.hpp"
#include "rtcf/parameter.hpp"

namespace rtcf::executor {

struct KeptParameters {
    std::vector<std::pair<std::string, ParameterValue>> kept;
    std::vector<std::string> notes;  ///< a line for each chosen value that is not kept, and why
};

/// Returns the values that a component takes over. The elements and the size of an array or a
/// vector are kept together or not at all: a filter with some of its coefficients is another
/// filter. They are known by their names: `taps_0`, `taps_1`, `taps_size`; `gain_0_0` of a matrix.
/// @param declared parameters of the component
/// @param given values that were chosen for it; they come before inherited ones
/// @param type of the component, for the notes
KeptParameters inheritedParameters(const std::vector<InheritedParameter>& inherited,
                                   const std::vector<ParameterBase*>& declared,
                                   const std::vector<std::pair<std::string, ParameterValue>>& given,
                                   const std::string& type);

/// A value as in a message.
std::string parameterText(const ParameterValue& value);

}  // namespace rtcf::executor
