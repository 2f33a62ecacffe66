/// @file
/// Serialises the values of one column of frames: outputs as ROS messages, states as in memory. One
/// thread; not real-time safe.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "watch/frame_table.hpp"

namespace rtcf::executor {

class PortPacker {
   public:
    /// @param column outlives this object
    /// @param offset offset of its values in a frame, bytes
    PortPacker(const FrameColumn& column, std::size_t offset);

    /// Size of each value, bytes.
    std::size_t length() const noexcept {
        return column_.output == nullptr ? column_.size : length_;
    }
    /// Appends the value of a frame to `to`.
    void pack(const std::uint8_t* values, std::string& to) const;

   private:
    const FrameColumn& column_;
    std::size_t offset_;
    std::shared_ptr<SlotHeader> slot_;
    std::uint32_t length_ = 0;
};

}  // namespace rtcf::executor
