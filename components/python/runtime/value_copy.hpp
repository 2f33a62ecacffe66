/// @file
/// Copies a value between a port, which has the layout of C++ components, and the record, which
/// stores arrays row by row.
#pragma once

#include <cstddef>
#include <cstring>

#include "tables.hpp"

namespace rtcf::python {

class ValueCopy {
   public:
    /// Not real-time safe.
    explicit ValueCopy(const TypeTable& type);

    /// @name Real-time safe
    /// @{
    void toRecord(void* field, const void* value) const noexcept {
        if (__builtin_expect(static_cast<long>(is_word_), 1) != 0) {
            std::memcpy(field, value, sizeof(double));
        } else {
            othersToRecord(field, value);
        }
    }
    void toPort(void* value, const void* field) const noexcept {
        if (__builtin_expect(static_cast<long>(is_word_), 1) != 0) {
            std::memcpy(value, field, sizeof(double));
        } else {
            othersToPort(value, field);
        }
    }
    /// @}

    std::size_t size() const noexcept { return size_; }  ///< bytes

   private:
    void othersToRecord(void* field, const void* value) const noexcept;
    void othersToPort(void* value, const void* field) const noexcept;

    std::size_t size_;
    std::size_t scalar_size_;
    std::size_t rows_;  // 0: the order of elements is the same in both
    std::size_t columns_;
    bool is_word_;  // 8 bytes, the most frequent size
};

}  // namespace rtcf::python
