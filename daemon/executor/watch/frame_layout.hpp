/// @file
/// The columns of a frame, and their layout for reading frames after the end of this process: a
/// FrameLayout of executor.proto. Made by the graph thread; immutable.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "frames/frame_ring.hpp"
#include "plugins/library.hpp"
#include "rtcf/port_type.hpp"

namespace rtcf::executor {

/// One output or state of a frame.
struct FrameColumn {
    std::string component;  ///< full name
    std::string name;
    std::string type;
    std::string unit;
    std::string mapped;                ///< outputs only: the name of its connection
    const TypeInfo* output = nullptr;  ///< null = a state
    std::size_t size = 0;              ///< size in the frame, bytes
    std::shared_ptr<const Library> library;

    std::string fullName() const { return component + "." + name; }
};

/// Serialises the layout of a ring.
/// @param columns its sources, in order
/// @param notes   omitted values, one line each
std::string frameLayout(const FrameRing& ring, const std::vector<FrameColumn>& columns,
                        const std::vector<std::string>& notes);

}  // namespace rtcf::executor
