/// @file
/// memcpy() that inlines the copies of common small sizes. Real-time safe.
#pragma once

#include <cstddef>
#include <cstring>

namespace rtcf::python {

template <std::size_t size>
void copyFixed(void* to, const void* from) noexcept {
    std::memcpy(to, from, size);
}

inline void copyBytes(void* to, const void* from, std::size_t size) noexcept {
    switch (size) {
        case 1:
            copyFixed<1>(to, from);
            break;
        case 4:
            copyFixed<4>(to, from);
            break;
        case 8:
            copyFixed<8>(to, from);
            break;
        case 16:
            copyFixed<16>(to, from);
            break;
        case 24:
            copyFixed<24>(to, from);
            break;
        case 32:
            copyFixed<32>(to, from);
            break;
        case 48:
            copyFixed<48>(to, from);
            break;
        default:
            std::memcpy(to, from, size);
    }
}

}  // namespace rtcf::python
