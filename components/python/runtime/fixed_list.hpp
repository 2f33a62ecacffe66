/// @file
/// List of objects that are contiguous in memory and never move: ports cannot be moved, and a cycle
/// iterates over them.
#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <utility>

namespace rtcf::python {

template <typename T>
class FixedList {
   public:
    FixedList() = default;
    FixedList(const FixedList&) = delete;
    FixedList& operator=(const FixedList&) = delete;
    ~FixedList() {
        while (size_ > 0) begin()[--size_].~T();
    }

    /// Allocates memory for all objects. Called once, before add(). Not real-time safe.
    void reserve(std::size_t count) {
        if (count > 0) memory_ = std::make_unique<Place[]>(count);
    }

    /// Constructs an object at the end. Not real-time safe.
    template <typename... Arguments>
    T& add(Arguments&&... arguments) {
        T* const made = new (&memory_[size_]) T(std::forward<Arguments>(arguments)...);
        ++size_;
        return *made;
    }

    /// @name Real-time safe
    /// @{
    T* begin() noexcept { return std::launder(reinterpret_cast<T*>(memory_.get())); }
    T* end() noexcept { return begin() + size_; }
    const T* begin() const noexcept { return std::launder(reinterpret_cast<T*>(memory_.get())); }
    const T* end() const noexcept { return begin() + size_; }
    /// @}

   private:
    struct Place {
        alignas(T) std::byte bytes[sizeof(T)];
    };

    std::unique_ptr<Place[]> memory_;
    std::size_t size_ = 0;
};

}  // namespace rtcf::python
