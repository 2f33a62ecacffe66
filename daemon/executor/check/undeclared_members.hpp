/// @file
/// Finds undeclared state of a component: bytes of the object that change from cycle to cycle and
/// belong neither to a port nor to a State. Memory that the object points to, such as the elements
/// of a std::vector, is not checked. Not real-time.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::executor {

class UndeclaredMembers {
   public:
    /// @param component made by an executor; outlives this object
    explicit UndeclaredMembers(const Component& component);

    /// Records the bytes that have changed since the last call. Between cycles.
    void look();
    /// The changed bytes, one line per range, e.g. "8 bytes at offset 304, after state integral".
    std::vector<std::string> found() const;

   private:
    // A declared member, in the order of their offsets.
    struct Field {
        std::size_t begin;
        std::size_t end;
        std::string name;
        bool may_change;
    };
    void add(const void* begin, std::size_t size, std::string name, bool may_change);

    const std::byte* object_ = nullptr;
    std::vector<std::byte> before_;
    std::vector<bool> changed_;
    std::vector<Field> fields_;
};

}  // namespace rtcf::executor
