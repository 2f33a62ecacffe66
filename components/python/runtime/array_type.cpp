#include "array_type.hpp"

#include <rtcf/eigen_type.hpp>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <new>
#include <sstream>
#include <utility>
#include <vector>

#include "scalar.hpp"

namespace rtcf::python {

namespace {

std::size_t countOf(const TypeTable& type) noexcept {
    return static_cast<std::size_t>(std::max<std::int64_t>(type.depth, 1) * type.rows *
                                    type.columns);
}

/// Eigen aligns a matrix to the largest power of two that divides its size, within bounds.
std::size_t alignmentOf(const TypeTable& type) noexcept {
    const std::size_t size = sizeOf(type);
    if (isMatrix(type)) {
        constexpr std::size_t kSmallest = 16, kLargest = EIGEN_MAX_STATIC_ALIGN_BYTES;
        const std::size_t divisor = size & (~size + 1);
        if (divisor >= kSmallest) return std::min(divisor, kLargest);
    }
    return sizeOf(type.scalar);
}

std::size_t valueOffset(const TypeTable& type) noexcept {
    const std::size_t alignment = alignmentOf(type);
    return (sizeof(SlotHeader) + alignment - 1) & ~(alignment - 1);
}

std::byte* valueOf(const TypeTable& type, SlotHeader* slot) {
    return reinterpret_cast<std::byte*>(slot) + valueOffset(type);
}

const std::byte* valueOf(const TypeTable& type, const SlotHeader* slot) {
    return reinterpret_cast<const std::byte*>(slot) + valueOffset(type);
}

/// Index of the element at a row and a column.
std::size_t placeOf(const TypeTable& type, std::int64_t row, std::int64_t column) noexcept {
    return static_cast<std::size_t>(isTransposed(type) ? column * type.rows + row
                                                       : row * type.columns + column);
}

template <typename T>
using ByColumns = Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>>;
template <typename T>
using ByRows = Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

template <typename T, typename Layout>
Layout matrixOf(const TypeTable& type, const void* value) {
    return Layout(static_cast<const T*>(value), type.rows, type.columns);
}

/// The C++ name of `std::array<T, count>`.
template <typename T>
std::string nameOfArray(std::size_t count) {
    constexpr std::size_t kAnother = 7;
    std::string name = detail::cppName<std::array<T, kAnother>>();
    return name.replace(name.rfind(std::to_string(kAnother)), 1, std::to_string(count));
}

template <typename T>
std::string nameOfMatrix(const TypeTable& type) {
    return fmt::format("Eigen::Matrix<{},{},{}>", detail::MultiArray<T>::scalar, type.rows,
                       type.columns);
}

struct FreeSlot {
    ComponentMemory* memory;
    std::size_t size;
    std::size_t alignment;
    void operator()(SlotHeader* slot) const noexcept {
        slot->~SlotHeader();
        detail::releaseTo(memory, slot, size, alignment);
    }
};

/// The description of a type, and the name that it points to.
struct Described {
    std::string name;
    TypeInfo info;
};

Described describe(const TypeTable& type) {
    Described made{};
    TypeInfo& info = made.info;
    info.md5 = info.ros_type = info.ros_md5 = info.ros_definition = "";
    if (isMatrix(type)) {
        withFloat(type.scalar, [&](auto scalar) {
            using Message = PortType<typename detail::MultiArray<decltype(scalar)>::Message>;
            made.name = nameOfMatrix<decltype(scalar)>(type);
            info.md5 = info.ros_md5 = Message::md5();
            info.ros_type = Message::name();
            info.ros_definition = Message::rosDefinition();
        });
    } else {
        made.name = withScalar(
            type.scalar, [&](auto scalar) { return nameOfArray<decltype(scalar)>(countOf(type)); });
    }
    info.size = sizeOf(type);
    info.alignment = alignmentOf(type);
    info.plain = false;
    info.fixed_size = true;
    info.flat = true;
    info.builds_message = false;
    info.is_double = false;
    info.make_slot = type.make_slot;
    info.copy = type.copy;
    info.exchange = type.exchange;
    info.length = type.length;
    info.serialize = type.serialize;
    info.deserialize = type.deserialize;
    info.print = type.print;
    info.finite = type.finite;
    info.sample = type.sample;
    info.copies = type.copies;
    return made;
}

template <typename T>
std::uint64_t identityOfState(const TypeTable& type) {
    std::uint64_t hash = StateType<T>::identity();
    if (type.depth > 0) {
        for (const std::int64_t size : {type.columns, type.rows, type.depth})
            hash = detail::stateHash(static_cast<std::uint64_t>(size),
                                     detail::stateHash("array", hash));
        return hash;
    }
    if (!isMatrix(type))
        return detail::stateHash(std::uint64_t{countOf(type)}, detail::stateHash("array", hash));
    hash = detail::stateHash(static_cast<std::uint64_t>(type.rows), hash);
    hash = detail::stateHash(static_cast<std::uint64_t>(type.columns), hash);
    return detail::stateHash(std::uint64_t{type.columns > 1 ? 1U : 0U}, hash);
}

template <typename T>
std::string nameOfState(const TypeTable& type) {
    if (type.depth > 0) {
        return fmt::format("{}[{}x{}x{}]", StateType<T>::name(), type.depth, type.rows,
                           type.columns);
    }
    if (!isMatrix(type)) return fmt::format("{}[{}]", StateType<T>::name(), countOf(type));
    return fmt::format("{}[{}x{}{}]", StateType<T>::name(), type.rows, type.columns,
                       isTransposed(type) ? ",RowMajor" : "");
}

template <typename T>
std::string printNumber(const void* value) {
    T number{};
    std::memcpy(&number, value, sizeof number);
    std::string text;
    StateType<T>::print(number, text);
    return text;
}

}  // namespace

std::size_t sizeOf(const TypeTable& type) noexcept {
    const std::size_t count = type.rows == 0 ? 1 : countOf(type);
    return count * sizeOf(type.scalar);
}

const TypeInfo& typeInfoOf(const TypeTable& type) {
    if (type.rows == 0) {
        return withScalar(type.scalar, [](auto scalar) -> const TypeInfo& {
            return typeInfo<decltype(scalar)>();
        });
    }
    if (type.scalar == Scalar::Double && type.rows == 3 && type.columns == 1)
        return typeInfo<Eigen::Vector3d>();
    static std::map<const TypeTable*, Described> known;  // components are constructed one at a time
    const auto [entry, is_new] = known.try_emplace(&type);
    if (is_new) {
        entry->second = describe(type);
        entry->second.info.name = entry->second.name.c_str();
    }
    return entry->second.info;
}

StateDeclaration stateOf(const TypeTable& type) {
    StateDeclaration state;
    state.size = sizeOf(type);
    withScalar(type.scalar, [&](auto scalar) {
        using T = decltype(scalar);
        const bool is_number = type.rows == 0;
        state.type = is_number ? StateType<T>::name() : nameOfState<T>(type);
        state.identity = is_number ? StateType<T>::identity() : identityOfState<T>(type);
        state.print = is_number ? &printNumber<T> : type.print_state;
    });
    return state;
}

std::shared_ptr<SlotHeader> rtcf_python_make_slot(const TypeTable* type, const SlotHeader* sample) {
    const std::size_t alignment = std::max(alignmentOf(*type), alignof(SlotHeader));
    const std::size_t size = valueOffset(*type) + sizeOf(*type);
    ComponentMemory* const memory = detail::constructionMemory();
    void* const block = detail::allocateFrom(memory, size, alignment);
    std::memset(block, 0, size);
    std::shared_ptr<SlotHeader> slot(new (block) SlotHeader, FreeSlot{memory, size, alignment});
    if (sample != nullptr)
        std::memcpy(valueOf(*type, slot.get()), valueOf(*type, sample), sizeOf(*type));
    return slot;
}

void rtcf_python_copy(const TypeTable* type, SlotHeader* to, const SlotHeader* from) {
    std::memcpy(valueOf(*type, to), valueOf(*type, from), sizeOf(*type));
    *to = *from;
}

void rtcf_python_exchange(const TypeTable* type, SlotHeader* a, SlotHeader* b) {
    std::byte* const value = valueOf(*type, a);
    std::swap_ranges(value, value + sizeOf(*type), valueOf(*type, b));
}

std::uint32_t rtcf_python_length(const TypeTable* type, const SlotHeader* /*slot*/) {
    const auto size = static_cast<std::uint32_t>(sizeOf(*type));
    return isMatrix(*type) ? detail::MatrixHead::kSize + size : size;
}

void rtcf_python_serialize(const TypeTable* type, const SlotHeader* slot, std::uint8_t* to,
                           std::uint32_t size) {
    const std::byte* const value = valueOf(*type, slot);
    if (!isMatrix(*type)) {
        std::memcpy(to, value, sizeOf(*type));
        return;
    }
    ros::serialization::OStream stream(to, size);
    detail::MatrixHead::write(stream, static_cast<std::uint32_t>(type->rows),
                              static_cast<std::uint32_t>(type->columns));
    withFloat(type->scalar, [&](auto scalar) {
        const auto* const elements = reinterpret_cast<const decltype(scalar)*>(value);
        for (std::int64_t row = 0; row < type->rows; ++row) {
            for (std::int64_t column = 0; column < type->columns; ++column)
                stream.next(elements[placeOf(*type, row, column)]);
        }
    });
}

bool rtcf_python_deserialize(const TypeTable* type, SlotHeader* slot, const std::uint8_t* from,
                             std::uint32_t size) {
    std::byte* const value = valueOf(*type, slot);
    if (!isMatrix(*type)) {
        if (size != sizeOf(*type)) return false;
        std::memcpy(value, from, size);
        return true;
    }
    try {
        withFloat(type->scalar, [&](auto scalar) {
            typename detail::MultiArray<decltype(scalar)>::Message message;
            PortType<decltype(message)>::deserialize(message, from, size);
            const auto* element = detail::matrixElements(message, countOf(*type));
            auto* const elements = reinterpret_cast<decltype(scalar)*>(value);
            for (std::int64_t row = 0; row < type->rows; ++row) {
                for (std::int64_t column = 0; column < type->columns; ++column)
                    elements[placeOf(*type, row, column)] = *element++;
            }
        });
        return true;
    } catch (...) {
        return false;
    }
}

std::string rtcf_python_print(const TypeTable* type, const SlotHeader* slot) {
    const std::byte* const value = valueOf(*type, slot);
    if (isMatrix(*type)) {
        return withFloat(type->scalar, [&](auto scalar) {
            using T = decltype(scalar);
            std::ostringstream text;
            detail::makeExact(text);
            const Eigen::IOFormat format(Eigen::StreamPrecision, Eigen::DontAlignCols, ", ", "; ",
                                         "", "", "[", "]");
            if (isTransposed(*type)) {
                text << matrixOf<T, ByColumns<T>>(*type, value).format(format);
            } else {
                text << matrixOf<T, ByRows<T>>(*type, value).format(format);
            }
            return text.str();
        });
    }
    return withScalar(type->scalar, [&](auto scalar) {
        const auto* const elements = reinterpret_cast<const decltype(scalar)*>(value);
        std::string text;
        detail::printAny(text, std::vector<decltype(scalar)>(elements, elements + countOf(*type)));
        return text;
    });
}

bool rtcf_python_finite(const TypeTable* type, const SlotHeader* slot) {
    if (!isMatrix(*type)) return true;
    return withFloat(type->scalar, [&](auto scalar) {
        using T = decltype(scalar);
        return matrixOf<T, ByColumns<T>>(*type, valueOf(*type, slot)).allFinite();
    });
}

std::string rtcf_python_sample(const TypeTable* type) {
    const std::shared_ptr<SlotHeader> slot = rtcf_python_make_slot(type, nullptr);
    std::string bytes(rtcf_python_length(type, slot.get()), '\0');
    rtcf_python_serialize(type, slot.get(), reinterpret_cast<std::uint8_t*>(bytes.data()),
                          static_cast<std::uint32_t>(bytes.size()));
    return bytes;
}

ByteCopies rtcf_python_copies(const TypeTable* type) {
    std::vector<ByteCopy> copies;
    if (!isTransposed(*type)) {
        const std::uint32_t to = isMatrix(*type) ? detail::MatrixHead::kSize : 0;
        copies.push_back({0, to, static_cast<std::uint32_t>(sizeOf(*type))});
        return copies;
    }
    const auto scalar = static_cast<std::uint32_t>(sizeOf(*type) / countOf(*type));
    std::uint32_t to = detail::MatrixHead::kSize;
    for (std::int64_t row = 0; row < type->rows; ++row) {
        for (std::int64_t column = 0; column < type->columns; ++column, to += scalar)
            copies.push_back(
                {static_cast<std::uint32_t>(placeOf(*type, row, column)) * scalar, to, scalar});
    }
    return copies;
}

std::string rtcf_python_print_state(const TypeTable* type, const void* value) {
    return withScalar(type->scalar, [&](auto scalar) {
        using T = decltype(scalar);
        std::string text;
        // The bytes may be unaligned.
        const auto elements = std::make_unique<T[]>(countOf(*type));
        std::memcpy(elements.get(), value, sizeOf(*type));
        if (type->depth > 0) {
            const auto row = static_cast<std::size_t>(type->columns);
            const auto matrix = static_cast<std::size_t>(type->rows) * row;
            for (std::size_t i = 0; i < countOf(*type); ++i) {
                const char* before = i % row == 0 ? "; " : ", ";
                if (i % matrix == 0) before = i == 0 ? "[[" : "], [";
                text += before;
                StateType<T>::print(elements[i], text);
            }
            text += "]]";
        } else if constexpr (std::is_floating_point_v<T>) {
            detail::printMatrix(matrixOf<T, ByRows<T>>(*type, elements.get()), text);
        } else {
            text += '[';
            for (std::size_t i = 0; i < countOf(*type); ++i) {
                if (i != 0) text += ", ";
                StateType<T>::print(elements[i], text);
            }
            text += ']';
        }
        return text;
    });
}

}  // namespace rtcf::python
