/// @file
/// Unknown enumerators. proto3 keeps any number in the place of an enumerator, and the last branch
/// of a switch takes it: requests are checked once, on arrival.
#pragma once

#include <google/protobuf/message.h>

namespace rtcf::executor {

/// Refuses a message with an enumerator that is not known, at any depth. Not real-time safe.
/// @throws Refusal InvalidArgument
void requireKnownValues(const google::protobuf::Message& message);

}  // namespace rtcf::executor
