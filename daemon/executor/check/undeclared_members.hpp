/// @file
/// Finds what a component remembers without declaring it: bytes of the object that change from
/// cycle to cycle and are neither a port nor a State. What it holds by pointer, as the elements of
/// a std::vector, is not looked at. Not real-time.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "rtcf/component.hpp"

namespace rtcf::executor {

class UndeclaredMembers {
   public:
    /// @param component by itself in memory from `new`; outlives this
    explicit UndeclaredMembers(const Component& component);

    /// Notes what has changed since the last call. Between cycles.
    void look();
    /// What has, a line each, e.g. "8 bytes at offset 304, after state integral".
    std::vector<std::string> found() const;

   private:
    // What is declared, in the order in which it lies in the object.
    struct Field {
        std::size_t begin;
        std::size_t end;
        std::string name;
        bool may_change;
    };
    void add(const void* begin, std::size_t size, std::string name, bool may_change);

    const std::byte* object_;
    std::vector<std::byte> before_;
    std::vector<bool> changed_;
    std::vector<Field> fields_;
};

}  // namespace rtcf::executor
