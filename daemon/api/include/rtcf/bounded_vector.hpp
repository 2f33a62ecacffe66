/// @file
/// A vector whose capacity is part of its type, for parameters.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string>

#include "rtcf/realtime.hpp"

namespace rtcf {

template <typename T>
class Parameter;

/// Up to N elements of type T, in the object itself. Real-time safe, but for the constructor from a
/// list, and for copies if those of T are not: std::string allocates.
template <typename T, std::size_t N>
class BoundedVector final {
    static_assert(N > 0, "a vector that can have elements");

   public:
    BoundedVector() = default;
    /// @throws std::length_error for more than N elements
    BoundedVector(std::initializer_list<T> elements)
        : size_(static_cast<std::int64_t>(elements.size())) {
        if (elements.size() > N) {
            throw std::length_error(std::to_string(elements.size()) + " elements of a vector of " +
                                    std::to_string(N));
        }
        std::copy(elements.begin(), elements.end(), elements_.begin());
    }

    std::size_t size() const noexcept RTCF_NONBLOCKING { return static_cast<std::size_t>(size_); }
    bool empty() const noexcept RTCF_NONBLOCKING { return size_ == 0; }
    static constexpr std::size_t capacity() noexcept RTCF_NONBLOCKING { return N; }
    /// @param index below size()
    const T& operator[](std::size_t index) const noexcept RTCF_NONBLOCKING {
        return elements_[index];
    }
    const T* data() const noexcept RTCF_NONBLOCKING { return elements_.data(); }
    auto begin() const noexcept RTCF_NONBLOCKING { return elements_.begin(); }
    auto end() const noexcept RTCF_NONBLOCKING { return elements_.begin() + size_; }

   private:
    friend class Parameter<BoundedVector>;
    std::array<T, N> elements_{};
    std::int64_t size_ = 0;
};

}  // namespace rtcf
