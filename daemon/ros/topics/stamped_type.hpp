/// @file
/// The messages that carry a number or a bool together with the time of the cycle that wrote it:
/// those of std_msgs have no header, by which tools that plot know a message's time.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace rtcf::ros1 {

/// As ROS describes a type of message.
struct MessageType {
    std::string name;
    std::string md5;
    std::string definition;
};

/// The message of ours that has a header and then the bytes of a message of std_msgs.
/// @return null if `ros_type` is none of a number or a bool
const MessageType* stampedType(const std::string& ros_type);

/// The bytes of such a message. @param stamp_ns ROS time
void stampBytes(const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns,
                std::vector<std::uint8_t>& stamped);

}  // namespace rtcf::ros1
