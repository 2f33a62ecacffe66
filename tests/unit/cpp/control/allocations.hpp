/// @file
/// Allocations of a component's update().
#pragma once

#include <cstddef>
#include <rtcf/component.hpp>

namespace rtcf::test {

/// Number of calls of malloc() and operator new in an update(), without log records: the bench's
/// log allocates. Always 0 with sanitizers, which replace malloc(); RealtimeSanitizer ends the
/// program at an allocation.
std::size_t allocationsInUpdate(Component& component);

}  // namespace rtcf::test
