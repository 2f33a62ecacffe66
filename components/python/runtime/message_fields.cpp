#include "message_fields.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <type_traits>

#include "copy_bytes.hpp"
#include "scalar.hpp"

namespace rtcf::python {

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

/// Calls `use` with the C++ type of a message's elements: a bool is a byte.
template <typename Use>
decltype(auto) withMessageScalar(Scalar scalar, Use&& use) {
    return withScalar(scalar, [&](auto value) -> decltype(auto) {
        if constexpr (std::is_same_v<decltype(value), bool>) {
            return use(std::uint8_t());
        } else {
            return use(value);
        }
    });
}

std::int64_t timeOf(const std::byte* field, bool is_duration) noexcept {
    std::array<std::int32_t, 2> parts{};
    std::memcpy(parts.data(), field, sizeof parts);
    if (is_duration) return parts[0] * kSecond + parts[1];
    return static_cast<std::uint32_t>(parts[0]) * kSecond + static_cast<std::uint32_t>(parts[1]);
}

/// Writes a time, clamped to the range of the field.
template <typename Seconds>
void setTime(std::byte* field, std::int64_t ns) noexcept {
    using Limits = std::numeric_limits<Seconds>;
    const std::int64_t rest = (ns % kSecond + kSecond) % kSecond;
    const auto seconds = static_cast<Seconds>(
        std::clamp<std::int64_t>((ns - rest) / kSecond, Limits::min(), Limits::max()));
    const auto nanoseconds = static_cast<std::uint32_t>(rest);
    std::memcpy(field, &seconds, sizeof seconds);
    std::memcpy(field + sizeof seconds, &nanoseconds, sizeof nanoseconds);
}

/// The elements of a sequence. A std::vector begins with the pointers to its begin and end;
/// messages do not contain std::vector<bool>, which differs.
struct Elements {
    std::byte* begin;
    std::byte* end;
};
static_assert(sizeof(std::vector<std::uint8_t>) == 3 * sizeof(std::byte*));

Elements elementsOf(const std::byte* sequence) noexcept {
    Elements elements{};
    std::memcpy(&elements, sequence, sizeof elements);
    return elements;
}

std::size_t bytesOf(const Elements& elements) noexcept {
    return static_cast<std::size_t>(elements.end - elements.begin);
}

void copyBools(std::byte* to, const std::byte* from, std::size_t count) noexcept {
    for (std::size_t i = 0; i < count; ++i) to[i] = std::byte{from[i] != std::byte{0}};
}

}  // namespace

MessageFields::MessageFields(const MessageTable& message, const LeafTable* leaves,
                             std::int64_t count) {
    for (std::int64_t i = 0; i < count; ++i) {
        const LeafTable& leaf = leaves[i];
        const MessageField& field = message.fields[leaf.field];
        const auto in_message = static_cast<std::size_t>(field.offset);
        const auto in_record = static_cast<std::size_t>(leaf.offset);
        const std::size_t size = sizeOf(field.scalar);
        if (field.form == Form::Time) {
            times_.push_back({in_message, in_record, field.scalar == Scalar::Int32});
        } else if (field.form == Form::Sequence) {
            sequences_.push_back(
                {in_message, in_record, size, static_cast<std::size_t>(leaf.largest),
                 leaf.count < 0 ? kNowhere : static_cast<std::size_t>(leaf.count), field.scalar});
        } else {
            const Numbers numbers{in_message, in_record,
                                  size * static_cast<std::size_t>(field.count)};
            field.scalar == Scalar::Bool ? bools_.push_back(numbers) : addNumbers(numbers);
        }
    }
}

/// Merges fields that are adjacent in the message and in the record, such as the six numbers of a
/// twist, so that they are copied at once.
void MessageFields::addNumbers(const Numbers& field) {
    if (!numbers_.empty()) {
        Numbers& last = numbers_.back();
        if (last.in_message + last.size == field.in_message &&
            last.in_record + last.size == field.in_record) {
            last.size += field.size;
            return;
        }
    }
    numbers_.push_back(field);
}

bool MessageFields::fit(const void* message) const noexcept {
    const auto* const bytes = static_cast<const std::byte*>(message);
    for (const Sequence& field : sequences_) {
        if (bytesOf(elementsOf(bytes + field.in_message)) > field.largest * field.scalar_size)
            return false;
    }
    return true;
}

void MessageFields::toRecord(std::byte* record, const void* message) const noexcept {
    const auto* const bytes = static_cast<const std::byte*>(message);
    for (const Numbers& field : numbers_)
        copyBytes(record + field.in_record, bytes + field.in_message, field.size);
    for (const Numbers& field : bools_)
        copyBools(record + field.in_record, bytes + field.in_message, field.size);
    for (const Time& field : times_) {
        const std::int64_t ns = timeOf(bytes + field.in_message, field.is_duration);
        std::memcpy(record + field.in_record, &ns, sizeof ns);
    }
    for (const Sequence& field : sequences_) {
        const Elements elements = elementsOf(bytes + field.in_message);
        const std::size_t size = bytesOf(elements);
        if (field.scalar == Scalar::Bool) {
            copyBools(record + field.in_record, elements.begin, size);
        } else if (size > 0) {
            std::memcpy(record + field.in_record, elements.begin, size);
        }
        if (field.counts == kNowhere) continue;
        const auto count = static_cast<std::int64_t>(size / field.scalar_size);
        std::memcpy(record + field.counts, &count, sizeof count);
    }
}

void MessageFields::toMessage(void* message, const std::byte* record) const noexcept {
    auto* const bytes = static_cast<std::byte*>(message);
    for (const Numbers& field : numbers_)
        copyBytes(bytes + field.in_message, record + field.in_record, field.size);
    for (const Numbers& field : bools_)
        copyBools(bytes + field.in_message, record + field.in_record, field.size);
    for (const Time& field : times_) {
        std::int64_t ns = 0;
        std::memcpy(&ns, record + field.in_record, sizeof ns);
        std::byte* const to = bytes + field.in_message;
        field.is_duration ? setTime<std::int32_t>(to, ns) : setTime<std::uint32_t>(to, ns);
    }
    for (const Sequence& field : sequences_) {
        const Elements elements = elementsOf(bytes + field.in_message);
        copyBytes(elements.begin, record + field.in_record,
                  std::min(bytesOf(elements), field.largest * field.scalar_size));
    }
}

void MessageFields::resize(void* message) const {
    auto* const bytes = static_cast<std::byte*>(message);
    for (const Sequence& field : sequences_) {
        withMessageScalar(field.scalar, [&](auto value) {
            using Values = std::vector<decltype(value)>;
            reinterpret_cast<Values*>(bytes + field.in_message)->resize(field.largest);
        });
    }
}

void setText(void* message, const MessageTable& table, const TextTable& text) {
    const MessageField& field = table.fields[text.field];
    std::byte* const place = static_cast<std::byte*>(message) + field.offset;
    const auto count = static_cast<std::size_t>(text.count);
    if (field.form == Form::TextSequence) {
        reinterpret_cast<std::vector<std::string>*>(place)->assign(text.texts, text.texts + count);
        return;
    }
    auto* const texts = reinterpret_cast<std::string*>(place);
    const std::size_t room = field.form == Form::Text ? 1 : static_cast<std::size_t>(field.count);
    for (std::size_t i = 0; i < std::min(count, room); ++i) texts[i] = text.texts[i];
}

}  // namespace rtcf::python
