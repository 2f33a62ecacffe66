#include "watch/extremes.hpp"

#include <cmath>
#include <cstring>
#include <type_traits>
#include <utility>

namespace rtcf::executor {

namespace {

// NaN counts as larger than all numbers, so that it is not hidden.
template <typename T>
bool isBelow(T a, T b) {
    if constexpr (std::is_floating_point_v<T>) {
        if (std::isnan(a)) return false;
        if (std::isnan(b)) return true;
    }
    return a < b;
}

struct Side {
    char* bytes;
    std::uint32_t* places;
};

template <typename T>
void compare(const char* value, std::size_t count, std::uint32_t place, Side least, Side most) {
    for (std::size_t i = 0; i < count; ++i) {
        T now;
        T low;
        T high;
        std::memcpy(&now, value + i * sizeof now, sizeof now);
        std::memcpy(&low, least.bytes + i * sizeof low, sizeof low);
        std::memcpy(&high, most.bytes + i * sizeof high, sizeof high);
        if (isBelow(now, low)) {
            std::memcpy(least.bytes + i * sizeof now, &now, sizeof now);
            least.places[i] = place;
        }
        if (isBelow(high, now)) {
            std::memcpy(most.bytes + i * sizeof now, &now, sizeof now);
            most.places[i] = place;
        }
    }
}

using Compare = void (*)(const char*, std::size_t, std::uint32_t, Side, Side);

Compare compareOf(NumberKind kind) {
    switch (kind) {
        case NumberKind::Bool:
        case NumberKind::UInt8:
            return compare<std::uint8_t>;
        case NumberKind::Int8:
            return compare<std::int8_t>;
        case NumberKind::Int16:
            return compare<std::int16_t>;
        case NumberKind::UInt16:
            return compare<std::uint16_t>;
        case NumberKind::Int32:
            return compare<std::int32_t>;
        case NumberKind::UInt32:
            return compare<std::uint32_t>;
        case NumberKind::Int64:
            return compare<std::int64_t>;
        case NumberKind::UInt64:
            return compare<std::uint64_t>;
        case NumberKind::Float32:
            return compare<float>;
        case NumberKind::Float64:
            break;
    }
    return compare<double>;
}

void append(const std::vector<std::uint32_t>& places, std::string& to) {
    to.append(reinterpret_cast<const char*>(places.data()), 4 * places.size());
}

}  // namespace

Extremes::Extremes(std::vector<NumberField> fields) : fields_(std::move(fields)) {
    for (const NumberField& field : fields_) numbers_ += field.count;
}

void Extremes::add(const std::string& value, std::uint32_t place) {
    if (least_.empty()) {
        least_ = most_ = value;
        least_places_.assign(numbers_, place);
        most_places_.assign(numbers_, place);
        return;
    }
    std::size_t number = 0;
    for (const NumberField& field : fields_) {
        compareOf(field.kind)(value.data() + field.offset, field.count, place,
                              {least_.data() + field.offset, least_places_.data() + number},
                              {most_.data() + field.offset, most_places_.data() + number});
        number += field.count;
    }
}

void Extremes::take(std::string& values, std::string& places) {
    values += least_;
    values += most_;
    append(least_places_, places);
    append(most_places_, places);
    least_.clear();
}

}  // namespace rtcf::executor
