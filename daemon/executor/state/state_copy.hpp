/// @file
/// Copies of declared state: from a component to its successor, back to its initial values, or to a
/// buffer that is shown to a user. The graph thread plans the copies; the cycle thread makes them
/// at one cycle boundary.
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

/// Size of all copies, bytes.
std::size_t bytesOf(const std::vector<StateCopy>& copies);

/// Plans the copies of state to a component's successor, by name and type. Appends to `copies`, and
/// appends to `notes` one line for each state that is not handed over.
void planHandOver(const Component& previous, const Component& successor,
                  std::vector<StateCopy>& copies, std::vector<std::string>& notes);

/// Plans the copies that reset a component's state to its initial values.
/// @param running the loop runs in real time: live state stays, see rtcf::Live
std::vector<StateCopy> planReset(const Component& component, bool running);

/// A copy of a component's state, of one cycle boundary.
class StateTexts {
   public:
    explicit StateTexts(const Component& component);
    /// The copies that fill it; valid as long as this object.
    std::vector<StateCopy> copies();
    /// The values as text, in the order of declaration, after the copies were made. Not real-time
    /// safe.
    std::vector<std::string> texts() const;

   private:
    const std::vector<StateDeclaration>& declared_;
    std::vector<std::byte> bytes_;
};

}  // namespace rtcf::executor
