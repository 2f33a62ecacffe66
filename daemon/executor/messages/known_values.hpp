/// @file
/// Check for unknown enumerators. proto3 accepts any number as an enumerator, and a switch would
/// take its last branch, so requests are checked once, on arrival.
#pragma once

#include <google/protobuf/message.h>

namespace rtcf::executor {

/// Requires that all enumerators of a message are known, at any depth. Not real-time safe.
/// @throws Error InvalidArgument
void requireKnownValues(const google::protobuf::Message& message);

}  // namespace rtcf::executor
