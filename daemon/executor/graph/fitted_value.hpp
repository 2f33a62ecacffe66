/// @file
/// The rule by which a parameter takes a value of another type, the same for launch files, graph
/// files, the parameter server and clients. declared_values.py has it for rtcfd.
#pragma once

#include "rtcf/parameter.hpp"

namespace rtcf::executor {

/// Converts a value to the type of a parameter where nothing is lost or doubtful. Not real-time.
///
/// A double takes an integer, and a text that is a number, as YAML 1.1 reads 1e-3 as text. An int
/// takes a whole double, a bool 0 and 1, and a string a number or a bool as its text. Other values
/// stay, and ParameterBase::check() rejects them.
void fit(const ParameterDeclaration& declaration, ParameterValue& value);

}  // namespace rtcf::executor
