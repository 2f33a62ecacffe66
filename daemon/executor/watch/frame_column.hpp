/// @file
/// One of the values that a frame holds. Made by the graph thread, never changed.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "plugins/library.hpp"
#include "rtcf/port_type.hpp"

namespace rtcf::executor {

/// One output or state of a frame.
struct FrameColumn {
    std::string component;  ///< full name
    std::string name;
    std::string type;
    std::string unit;
    std::string mapped;                ///< of an output: the name of its connection
    const TypeInfo* output = nullptr;  ///< null: a state
    std::size_t size = 0;              ///< bytes in the frame
    std::shared_ptr<const Library> library;

    std::string fullName() const { return component + "." + name; }
};

}  // namespace rtcf::executor
