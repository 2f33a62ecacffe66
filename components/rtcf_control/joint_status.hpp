/// @file
/// The output `status` of components that read or write messages of several joints.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <std_msgs/String.h>

#include <rtcf/component.hpp>

#include "joint_names.hpp"

namespace rtcf_control {

/// Quantities of a joint, in the order of sensor_msgs/JointState.
constexpr std::array<const char*, 3> kQuantities{"position", "velocity", "effort"};

/// Reason of a status.
/// @tparam Kind enum of a component; its first value means that there is no status yet
template <typename Kind>
struct JointFinding {
    Kind kind{};
    std::uint32_t quantity = 0;  ///< index in kQuantities
    std::uint32_t joints = 0;    ///< bit i is joint i

    bool operator!=(const JointFinding& other) const {
        return kind != other.kind || quantity != other.quantity || joints != other.joints;
    }
    template <typename Visit>
    void fields(Visit&& visit) {
        visit("kind", kind);
        visit("quantity", quantity);
        visit("joints", joints);
    }
};

/// A text that is written when its reason changes. Owned by its component; the reason is state.
template <typename Kind>
class JointStatus {
   public:
    using Finding = JointFinding<Kind>;

    explicit JointStatus(rtcf::Component* owner)
        : output_(owner, "status"),
          finding_(owner, "finding", {}, rtcf::Doc("reason of the status")) {}

    /// Reserves memory for the longest text. Not real-time safe.
    /// @param size of a text without the names of joints
    void reserve(std::size_t size, const std::vector<std::string>& joints) {
        std_msgs::String text;
        text.data.resize(size + namesSize(joints));
        output_.reserve(text);
    }
    /// Forgets the reason, so that the next one is written. Real-time safe.
    void begin() noexcept { finding_ = Finding{}; }
    /// Real-time safe within the reserved memory.
    /// @param append appends the text of `found` to a string
    /// @return the present text
    template <typename Append>
    const std::string& set(const Finding& found, const Append& append) {
        std::string& text = output_.value().data;
        if (found != finding_.value()) {
            finding_ = found;
            text.clear();
            append(text);
            output_.publish();
        }
        return text;
    }

   private:
    rtcf::Output<std_msgs::String> output_;
    rtcf::State<Finding> finding_;
};

}  // namespace rtcf_control
