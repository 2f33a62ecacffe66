/// @file
/// Serialization of messages with texts of components. A `string` field must be UTF-8: the reader
/// rejects a whole message for one other byte, and rtcfd then closes its connection. So all
/// messages that leave the executor are serialized here. Not real-time safe; any thread.
#pragma once

#include <google/protobuf/message.h>

#include <string>

namespace rtcf::executor {

/// The message as bytes. In all its `string` fields, U+FFFD replaces invalid UTF-8.
std::string serialized(const google::protobuf::Message& message);

}  // namespace rtcf::executor
