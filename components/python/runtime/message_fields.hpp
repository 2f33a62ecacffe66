/// @file
/// Copies numbers between a ROS message and the component's record.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tables.hpp"

namespace rtcf::python {

/// The fields of a message that a component uses.
class MessageFields {
   public:
    MessageFields(const MessageTable& message, const LeafTable* leaves, std::int64_t count);

    /// Real-time safe. @return whether the record has space for all elements of the message
    bool fit(const void* message) const noexcept;
    /// Copies a message to the record. Precondition: fit(message). Real-time safe.
    void toRecord(std::byte* record, const void* message) const noexcept;
    /// Copies the record to a message. Precondition: resize(message) was called. Real-time safe.
    void toMessage(void* message, const std::byte* record) const noexcept;
    /// Resizes the arrays of a message to their sizes in the record. Not real-time safe.
    void resize(void* message) const;

   private:
    /// Numbers with the same layout in message and record: one, an array, or several fields.
    struct Numbers {
        std::size_t in_message;
        std::size_t in_record;
        std::size_t size;  // bytes
    };
    struct Time {
        std::size_t in_message;
        std::size_t in_record;
        bool is_duration;
    };
    struct Sequence {
        std::size_t in_message;
        std::size_t in_record;
        std::size_t scalar_size;  // bytes
        std::size_t largest;      // elements
        std::size_t counts;       // offset of the number of elements in the record, or kNowhere
        Scalar scalar;
    };
    static constexpr std::size_t kNowhere = ~std::size_t{0};

    void addNumbers(const Numbers& field);

    std::vector<Numbers> numbers_;
    std::vector<Numbers> bools_;  // in a message, any byte but 0 is true
    std::vector<Time> times_;
    std::vector<Sequence> sequences_;
};

/// Writes constant strings to a message. Not real-time safe.
void setText(void* message, const MessageTable& table, const TextTable& text);

}  // namespace rtcf::python
