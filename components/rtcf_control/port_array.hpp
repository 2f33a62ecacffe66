/// @file
/// Ports of one type with numbered names: "in1", "in2", and so on.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <string>

#include <rtcf/component.hpp>

namespace rtcf_control {

template <typename Port, std::size_t Size>
using Ports = std::array<std::unique_ptr<Port>, Size>;

/// Makes the ports "NAME1" to "NAME<Size>" of a component. Not real-time.
/// @param options further arguments of the port's constructor
template <typename Port, std::size_t Size, typename... Options>
Ports<Port, Size> makePorts(rtcf::Component* owner, const std::string& name,
                            const Options&... options) {
    Ports<Port, Size> ports;
    for (std::size_t i = 0; i < Size; ++i)
        ports[i] = std::make_unique<Port>(owner, name + std::to_string(i + 1), options...);
    return ports;
}

/// "NAME1" to "NAME<Size>".
template <std::size_t Size>
std::array<std::string, Size> numberedNames(const std::string& name) {
    std::array<std::string, Size> names;
    for (std::size_t i = 0; i < Size; ++i) names[i] = name + std::to_string(i + 1);
    return names;
}

}  // namespace rtcf_control
