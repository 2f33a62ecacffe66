/// @file
/// Copies the numbers of a ROS message between the message and the component's record.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tables.hpp"

namespace rtcf::python {

/// The numbers of a message that a component uses.
class MessageFields {
   public:
    MessageFields(const MessageTable& message, const LeafTable* leaves, std::int64_t count);

    /// True if the record has room for all elements of the message. Real-time safe.
    bool fit(const void* message) const noexcept;
    /// Copies a message that fits into the record. Real-time safe.
    void toRecord(std::byte* record, const void* message) const noexcept;
    /// Copies the record into a message that has the sizes of prepare(). Real-time safe.
    void toMessage(void* message, const std::byte* record) const noexcept;
    /// Gives a message's arrays the size that the record has room for. Not real-time safe.
    void resize(void* message) const;

   private:
    /// Numbers of fixed size that lie the same in both: one, an array, or several fields.
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
        std::size_t counts;       // where the record has the number of elements, or kNowhere
        Scalar scalar;
    };
    static constexpr std::size_t kNowhere = ~std::size_t{0};

    void addNumbers(const Numbers& field);

    std::vector<Numbers> numbers_;
    std::vector<Numbers> bools_;  // in a message any byte but 0 is true
    std::vector<Time> times_;
    std::vector<Sequence> sequences_;
};

/// Puts constant texts into a message. Not real-time safe.
void setText(void* message, const MessageTable& table, const TextTable& text);

}  // namespace rtcf::python
