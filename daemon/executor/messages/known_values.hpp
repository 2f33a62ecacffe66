/// @file
/// Enumerators that are none. proto3 keeps any number in the place of an enumerator, and a switch
/// takes it for whatever is left over: requests are looked at once, where they come in.
#pragma once

#include <google/protobuf/message.h>

namespace rtcf::executor {

/// Refuses a message with an enumerator that is not known, at any depth. Not real-time safe.
/// @throws Refusal InvalidArgument
void requireKnownValues(const google::protobuf::Message& message);

}  // namespace rtcf::executor
