/// @file
/// Messages with a number or a bool and the stamp of its cycle. The types of std_msgs have no
/// header, which plotting tools need.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace rtcf::ros1 {

/// Description of a ROS message type.
struct MessageType {
    std::string name;
    std::string md5;
    std::string definition;
};

/// The type of rtcf_msgs with a header followed by the bytes of a message of std_msgs.
/// @return null if `ros_type` is not a number or a bool
const MessageType* stampedType(const std::string& ros_type);

/// Makes the bytes of such a message.
/// @param stamp_ns ROS time, ns
void stampBytes(const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns,
                std::vector<std::uint8_t>& stamped);

}  // namespace rtcf::ros1
