/// @file
/// Values of one column of a frame, as they travel: of outputs as ROS messages, of states as they
/// lie in memory. One thread; not real-time safe.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "watch/frame_table.hpp"

namespace rtcf::executor {

class PortPacker {
   public:
    /// @param column outlives this
    /// @param offset of its values in a frame, bytes
    PortPacker(const FrameColumn& column, std::size_t offset);

    /// Bytes of each value.
    std::size_t length() const noexcept {
        return column_.output == nullptr ? column_.size : length_;
    }
    /// Appends the value of a frame.
    void pack(const std::uint8_t* values, std::string& to) const;

   private:
    const FrameColumn& column_;
    std::size_t offset_;
    std::shared_ptr<SlotHeader> slot_;
    std::uint32_t length_ = 0;
};

}  // namespace rtcf::executor
