/// @file
/// Declared state on its way: from a component to its successor, back to its initial values, or to
/// a place where it can be looked at. What is to be copied is worked out by the graph thread; the
/// copies are made at one cycle boundary.
#pragma once

#include <cstddef>
#include <cstring>
#include <string>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::executor {

/// Bytes to copy at a boundary.
struct StateCopy {
    void* to;
    const void* from;
    std::size_t size;

    void copy() const noexcept { std::memcpy(to, from, size); }
};

/// Of all of them.
std::size_t bytesOf(const std::vector<StateCopy>& copies);

/// What of a component's state is copied to one that takes its place: by name and type.
/// Appends to `copies`, and to `notes` one line for each state that does not go over.
void planHandOver(const Component& previous, const Component& successor,
                  std::vector<StateCopy>& copies, std::vector<std::string>& notes);

/// Copies that take a component's state back to its initial values.
std::vector<StateCopy> planReset(const Component& component);

/// The state of a component, all of one cycle boundary.
class StatePicture {
   public:
    explicit StatePicture(const Component& component);
    /// What fills it; valid as long as this.
    std::vector<StateCopy> copies();
    /// After that: the values as text, in the order of declaration. Not real-time safe.
    std::vector<std::string> texts() const;

   private:
    const std::vector<StateDeclaration>& declared_;
    std::vector<std::byte> bytes_;
};

}  // namespace rtcf::executor
