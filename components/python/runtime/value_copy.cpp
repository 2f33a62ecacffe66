#include "value_copy.hpp"

#include "array_type.hpp"
#include "copy_bytes.hpp"
#include "scalar.hpp"

namespace rtcf::python {

namespace {

/// Copies a matrix that is stored column by column to a matrix stored row by row.
template <typename T>
void transposeAs(void* to, const void* from, std::size_t rows, std::size_t columns) noexcept {
    const T* const source = static_cast<const T*>(from);
    T* target = static_cast<T*>(to);
    for (std::size_t row = 0; row < rows; ++row) {
        for (std::size_t column = 0; column < columns; ++column)
            *target++ = source[column * rows + row];
    }
}

void transpose(void* to, const void* from, std::size_t rows, std::size_t columns,
               std::size_t scalar_size) noexcept {
    scalar_size == sizeof(double) ? transposeAs<double>(to, from, rows, columns)
                                  : transposeAs<float>(to, from, rows, columns);
}

}  // namespace

ValueCopy::ValueCopy(const TypeTable& type)
    : size_(sizeOf(type)),
      scalar_size_(sizeOf(type.scalar)),
      rows_(isTransposed(type) ? static_cast<std::size_t>(type.rows) : 0),
      columns_(static_cast<std::size_t>(type.columns)),
      is_word_(size_ == sizeof(double)) {}

void ValueCopy::othersToRecord(void* field, const void* value) const noexcept {
    if (rows_ == 0) {
        copyBytes(field, value, size_);
    } else {
        transpose(field, value, rows_, columns_, scalar_size_);
    }
}

void ValueCopy::othersToPort(void* value, const void* field) const noexcept {
    if (rows_ == 0) {
        copyBytes(value, field, size_);
    } else {
        transpose(value, field, columns_, rows_, scalar_size_);
    }
}

}  // namespace rtcf::python
