#include "ros/topics/stamped_type.hpp"

#include <ros/message_traits.h>
#include <ros/serialization.h>
#include <rtcf_msgs/BoolStamped.h>
#include <rtcf_msgs/Float32Stamped.h>
#include <rtcf_msgs/Float64Stamped.h>
#include <rtcf_msgs/Int16Stamped.h>
#include <rtcf_msgs/Int32Stamped.h>
#include <rtcf_msgs/Int64Stamped.h>
#include <rtcf_msgs/Int8Stamped.h>
#include <rtcf_msgs/UInt16Stamped.h>
#include <rtcf_msgs/UInt32Stamped.h>
#include <rtcf_msgs/UInt64Stamped.h>
#include <rtcf_msgs/UInt8Stamped.h>
#include <std_msgs/Header.h>

#include <algorithm>
#include <cstring>
#include <map>

namespace rtcf::ros1 {

namespace {

template <typename Message>
MessageType described() {
    return {ros::message_traits::datatype<Message>(), ros::message_traits::md5sum<Message>(),
            ros::message_traits::definition<Message>()};
}

}  // namespace

const MessageType* stampedType(const std::string& ros_type) {
    static const std::map<std::string, MessageType> types = {
        {"std_msgs/Bool", described<rtcf_msgs::BoolStamped>()},
        {"std_msgs/Float32", described<rtcf_msgs::Float32Stamped>()},
        {"std_msgs/Float64", described<rtcf_msgs::Float64Stamped>()},
        {"std_msgs/Int8", described<rtcf_msgs::Int8Stamped>()},
        {"std_msgs/Int16", described<rtcf_msgs::Int16Stamped>()},
        {"std_msgs/Int32", described<rtcf_msgs::Int32Stamped>()},
        {"std_msgs/Int64", described<rtcf_msgs::Int64Stamped>()},
        {"std_msgs/UInt8", described<rtcf_msgs::UInt8Stamped>()},
        {"std_msgs/UInt16", described<rtcf_msgs::UInt16Stamped>()},
        {"std_msgs/UInt32", described<rtcf_msgs::UInt32Stamped>()},
        {"std_msgs/UInt64", described<rtcf_msgs::UInt64Stamped>()},
    };
    const auto found = types.find(ros_type);
    return found == types.end() ? nullptr : &found->second;
}

void stampBytes(const std::uint8_t* bytes, std::uint32_t size, std::int64_t stamp_ns,
                std::vector<std::uint8_t>& stamped) {
    std_msgs::Header header;  // roscpp sets the sequence number
    header.stamp.fromNSec(static_cast<std::uint64_t>(std::max<std::int64_t>(stamp_ns, 0)));
    const std::uint32_t length = ros::serialization::serializationLength(header);
    stamped.resize(length + size);
    ros::serialization::OStream stream(stamped.data(), length);
    ros::serialization::serialize(stream, header);
    std::memcpy(stamped.data() + length, bytes, size);
}

}  // namespace rtcf::ros1
