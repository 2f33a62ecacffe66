/// @file
/// Run-time description of a port's type: its identity, and functions that handle its values
/// without knowing the type. One TypeInfo exists per type and component library.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "rtcf/component_memory.hpp"
#include "rtcf/finite.hpp"
#include "rtcf/realtime.hpp"
#include "rtcf/slot.hpp"

namespace rtcf {

/// A range of bytes that is the same in a value and in its serialised message.
struct ByteCopy {
    std::uint32_t from;  ///< bytes from the beginning of the value
    std::uint32_t to;    ///< bytes from the beginning of the serialised message
    std::uint32_t size;  ///< bytes
    friend bool operator==(const ByteCopy& a, const ByteCopy& b) noexcept {
        return a.from == b.from && a.to == b.to && a.size == b.size;
    }
};

/// The copies that turn a value into its message: all bytes that differ between messages of the
/// type. Unset if only the type's code can make the message.
using ByteCopies = std::optional<std::vector<ByteCopy>>;

/// Type-erased description of a port's type. All functions take slots of this type.
struct TypeInfo {
    /// @name Identity
    /// Two ports can be connected if all four are equal, or if both are plain and have the same
    /// message, size and alignment.
    /// @{
    const char* name;  ///< e.g. "std_msgs/Float64", "double"
    /// MD5 of the ROS definition, or of the mapped message. For a struct that names its fields, a
    /// hash of these.
    const char* md5;
    std::size_t size;
    std::size_t alignment;
    /// @}

    /// @name The ROS message of these values; empty if there is none
    /// @{
    const char* ros_type;
    const char* ros_md5;
    const char* ros_definition;
    /// @}

    /// The value has the same memory layout as the message `ros_type`, e.g. `double` and
    /// std_msgs/Float64.
    bool plain;
    bool fixed_size;  ///< flat, and every value has the same serialised length
    /// The value owns no memory outside its `size` bytes, so copying it never allocates.
    bool flat;
    /// length() and serialize() build a message of variable size first, so they may allocate.
    bool builds_message;
    /// The value is one double: `double` or std_msgs/Float64. The executor handles most values
    /// without calls by this.
    bool is_double;

    /// Makes a slot, with a copy of the sample's value unless `sample` is null. Not real-time safe.
    std::shared_ptr<SlotHeader> (*make_slot)(const SlotHeader* sample);
    /// Copies value and header. Real-time safe for fixed-size types, and for other types if the
    /// target's capacity suffices.
    void (*copy)(SlotHeader& to, const SlotHeader& from);
    /// Swaps the values, but not the headers, of two slots. Real-time safe.
    void (*exchange)(SlotHeader& a, SlotHeader& b);
    /// Serialised length in bytes. Real-time safe unless `builds_message`.
    std::uint32_t (*length)(const SlotHeader& slot);
    /// Writes length() bytes. Real-time safe unless `builds_message`.
    void (*serialize)(const SlotHeader& slot, std::uint8_t* to, std::uint32_t size);
    /// Deserialises a message into the slot's value. Not real-time safe.
    /// @return false if the bytes are not a valid message
    bool (*deserialize)(SlotHeader& slot, const std::uint8_t* from, std::uint32_t size);
    /// Prints the value on one line. Not real-time safe.
    std::string (*print)(const SlotHeader& slot);
    /// True if the value contains no NaN and no infinity. Real-time safe.
    bool (*finite)(const SlotHeader& slot);
    /// A serialised message of any value, made without the component's conversion functions. Not
    /// real-time safe.
    std::string (*sample)();
    /// The copies that turn the sample and a value into a message, for types of fixed size. Not
    /// real-time safe.
    ByteCopies (*copies)();
};

/// True if only a type's source file knows its definition: it is of an anonymous namespace, and
/// does not name its fields. Not real-time: it searches a text.
inline bool isPrivate(const TypeInfo& type) noexcept {
    return *type.md5 == '\0' &&
           std::string_view(type.name).find("(anonymous namespace)") != std::string_view::npos;
}

/// True if ports of the two types can be connected. Not real-time: it compares texts.
bool sameType(const TypeInfo& a, const TypeInfo& b) noexcept;

/// Largest value of fixed size whose readers have the writer's slot, bytes. If update() throws, the
/// value is restored from the last frame. Larger ones are staged, see OutputPort: there, a copy
/// after each write costs less per cycle.
constexpr std::size_t kLargestShared = 4096;

/// True if readers of an output of this type may read the slot that write() fills. Real-time safe.
inline bool isShared(const TypeInfo& type) noexcept RTCF_NONBLOCKING {
    return type.fixed_size && type.size <= kLargestShared;
}

/// True if both the value and its message own memory. The message then has to be built from a copy,
/// outside the cycle. Real-time safe.
inline bool allocatesMessage(const TypeInfo& type) noexcept RTCF_NONBLOCKING {
    return type.builds_message && !type.flat;
}

/// Address of a slot's value. Real-time safe.
inline const std::uint8_t* valueOf(const TypeInfo& type, const SlotHeader& slot) noexcept
    RTCF_NONBLOCKING {
    const std::size_t offset = (sizeof slot + type.alignment - 1) / type.alignment * type.alignment;
    return reinterpret_cast<const std::uint8_t*>(&slot) + offset;
}
inline std::uint8_t* valueOf(const TypeInfo& type, SlotHeader& slot) noexcept RTCF_NONBLOCKING {
    return const_cast<std::uint8_t*>(valueOf(type, static_cast<const SlotHeader&>(slot)));
}

/// Makes a type a port type. Specialised in message_type.hpp, arithmetic_type.hpp, eigen_type.hpp
/// and any_type.hpp. The members correspond to those of TypeInfo. A specialisation has
///  - `static const char* name()`, `md5()`, `rosType()`, `rosMd5()`, `rosDefinition()`
///  - `static constexpr bool kFixedSize`; `kPlain` and `kBuildsMessage`, if true
///  - `static std::uint32_t length(const T&)`
///  - `static void serialize(const T&, std::uint8_t*, std::uint32_t)`
///  - `static void deserialize(T&, const std::uint8_t*, std::uint32_t)`, which throws on bad bytes
///  - `static std::string print(const T&)`
/// and optionally
///  - `static std::string sample()`; without it, the message of a default-constructed value
///  - `static ByteCopies copies()`; without it, only the type's own code makes its messages
template <typename T, typename Enable = void>
struct PortType;

namespace detail {

template <typename T>
std::shared_ptr<SlotHeader> makeSlot(const SlotHeader* sample) {
    auto slot = makeBeside<Slot<T>>();
    if (sample != nullptr) slot->value = static_cast<const Slot<T>*>(sample)->value;
    return slot;
}

template <typename T>
void copySlot(SlotHeader& to, const SlotHeader& from) {
    static_cast<Slot<T>&>(to).value = static_cast<const Slot<T>&>(from).value;
    to = from;
}

template <typename T>
std::uint32_t slotLength(const SlotHeader& slot) {
    return PortType<T>::length(static_cast<const Slot<T>&>(slot).value);
}

template <typename T>
void serializeSlot(const SlotHeader& slot, std::uint8_t* to, std::uint32_t size) {
    PortType<T>::serialize(static_cast<const Slot<T>&>(slot).value, to, size);
}

template <typename T>
bool deserializeSlot(SlotHeader& slot, const std::uint8_t* from, std::uint32_t size) {
    try {
        PortType<T>::deserialize(static_cast<Slot<T>&>(slot).value, from, size);
        return true;
    } catch (...) {
        return false;
    }
}

template <typename T>
void exchangeSlots(SlotHeader& a, SlotHeader& b) {
    using std::swap;
    swap(static_cast<Slot<T>&>(a).value, static_cast<Slot<T>&>(b).value);
}

template <typename T>
bool finiteSlot(const SlotHeader& slot) {
    return isFinite(static_cast<const Slot<T>&>(slot).value);
}

template <typename T, typename = void>
struct IsPlain : std::false_type {};
template <typename T>
struct IsPlain<T, std::void_t<decltype(PortType<T>::kPlain)>>
    : std::bool_constant<PortType<T>::kPlain> {};

template <typename T, typename = void>
struct HasSample : std::false_type {};
template <typename T>
struct HasSample<T, std::void_t<decltype(T::sample())>> : std::true_type {};

template <typename T, typename = void>
struct HasCopies : std::false_type {};
template <typename T>
struct HasCopies<T, std::void_t<decltype(T::copies())>> : std::true_type {};

template <typename T>
std::string sampleOf() {
    if constexpr (HasSample<PortType<T>>::value) {
        return PortType<T>::sample();
    } else {
        const auto value = std::make_unique<T>();
        std::string bytes(PortType<T>::length(*value), '\0');
        PortType<T>::serialize(*value, reinterpret_cast<std::uint8_t*>(bytes.data()),
                               static_cast<std::uint32_t>(bytes.size()));
        return bytes;
    }
}

template <typename T>
ByteCopies copiesOf() {
    if constexpr (PortType<T>::kFixedSize && HasCopies<PortType<T>>::value) {
        return PortType<T>::copies();
    } else {
        return std::nullopt;
    }
}

/// A trivially destructible type owns no memory.
template <typename T>
constexpr bool kIsFlat = PortType<T>::kFixedSize || std::is_trivially_destructible_v<T>;

template <typename T, typename = void>
struct BuildsMessage : std::false_type {};
template <typename T>
struct BuildsMessage<T, std::void_t<decltype(PortType<T>::kBuildsMessage)>>
    : std::bool_constant<PortType<T>::kBuildsMessage> {};

template <typename T>
std::string printSlot(const SlotHeader& slot) {
    return PortType<T>::print(static_cast<const Slot<T>&>(slot).value);
}

}  // namespace detail

/// The description of T. Not real-time safe at the first call.
template <typename T>
const TypeInfo& typeInfo() {
    static const TypeInfo info{
        PortType<T>::name(),
        PortType<T>::md5(),
        sizeof(T),
        alignof(T),
        PortType<T>::rosType(),
        PortType<T>::rosMd5(),
        PortType<T>::rosDefinition(),
        detail::IsPlain<T>::value,
        PortType<T>::kFixedSize,
        detail::kIsFlat<T>,
        detail::BuildsMessage<T>::value,
        detail::IsPlain<T>::value && std::string_view(PortType<T>::rosType()) == "std_msgs/Float64",
        &detail::makeSlot<T>,
        &detail::copySlot<T>,
        &detail::exchangeSlots<T>,
        &detail::slotLength<T>,
        &detail::serializeSlot<T>,
        &detail::deserializeSlot<T>,
        &detail::printSlot<T>,
        &detail::finiteSlot<T>,
        &detail::sampleOf<T>,
        &detail::copiesOf<T>};
    return info;
}

inline bool sameType(const TypeInfo& a, const TypeInfo& b) noexcept {
    // Each library has its own TypeInfo objects, so compare the content.
    if (&a == &b) return true;
    if (a.size != b.size || a.alignment != b.alignment) return false;
    if (std::string_view(a.name) == b.name)
        return std::string_view(a.md5) == b.md5 && !isPrivate(a);
    return a.plain && b.plain && std::string_view(a.ros_type) == b.ros_type &&
           std::string_view(a.ros_md5) == b.ros_md5;
}

}  // namespace rtcf
