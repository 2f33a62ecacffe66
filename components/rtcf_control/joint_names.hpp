/// @file
/// Joints by name: the parameter `joints` of components with several joints, and the names in their
/// messages.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace rtcf_control {

constexpr std::size_t kMostJoints = 16;
/// Of a message; bounds the work of a cycle.
constexpr std::size_t kMostNames = 1024;

/// Reason why a list cannot be the parameter `joints`; empty if it can. Not real-time safe.
inline std::string jointsError(const std::vector<std::string>& joints) {
    if (joints.empty() || joints.size() > kMostJoints)
        return fmt::format("joints has {} names; write 1 to {}", joints.size(), kMostJoints);
    std::vector<std::string> sorted = joints;
    std::sort(sorted.begin(), sorted.end());
    const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
    if (twice != sorted.end()) return fmt::format("joints has {} twice", *twice);
    return {};
}

/// Places of joints in the arrays of a message.
class JointPlaces {
   public:
    static constexpr std::size_t kAbsent = static_cast<std::size_t>(-1);

    /// Finds joints in the names of a message. A message without names has the order of `joints`.
    /// Real-time safe.
    /// @param names at most kMostNames count
    /// @param joints at most kMostJoints
    /// @return the first joint that `names` has twice; joints.size() if there is none
    std::size_t find(const std::vector<std::string>& names,
                     const std::vector<std::string>& joints) noexcept {
        for (std::size_t i = 0; i < joints.size(); ++i) places_[i] = names.empty() ? i : kAbsent;
        missing_ = 0;
        for (std::size_t at = 0; at < std::min(names.size(), kMostNames); ++at) {
            for (std::size_t i = 0; i < joints.size(); ++i) {
                if (names[at] != joints[i]) continue;
                if (places_[i] != kAbsent) return i;
                places_[i] = at;
                break;
            }
        }
        for (std::size_t i = 0; i < joints.size(); ++i)
            missing_ |= places_[i] == kAbsent ? 1U << i : 0U;
        return joints.size();
    }

    /// Index in the message, or kAbsent. Real-time safe.
    std::size_t operator[](std::size_t joint) const noexcept { return places_[joint]; }
    /// The joints that are not in the message: bit i is joint i. Real-time safe.
    std::uint32_t missing() const noexcept { return missing_; }

   private:
    std::array<std::size_t, kMostJoints> places_{};
    std::uint32_t missing_ = 0;
};

/// Appends the names of joints, separated by commas. Real-time safe within the capacity of `text`.
/// @param selected bit i is joint i
inline void appendNames(std::string& text, const std::vector<std::string>& joints,
                        std::uint32_t selected) {
    const char* separator = "";
    for (std::size_t i = 0; i < joints.size(); ++i) {
        if ((selected >> i & 1U) == 0) continue;
        text.append(separator).append(joints[i]);
        separator = ", ";
    }
}

/// Size of a text of appendNames() with all joints. Real-time safe.
inline std::size_t namesSize(const std::vector<std::string>& joints) noexcept {
    std::size_t size = 0;
    for (const std::string& joint : joints) size += joint.size() + 2;
    return size;
}

}  // namespace rtcf_control
