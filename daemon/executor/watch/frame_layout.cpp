#include "watch/frame_layout.hpp"

#include <cstring>
#include <map>
#include <vector>

#include "rtcf/executor/v1/executor.pb.h"
#include "state/image_work.hpp"

namespace rtcf::executor {

namespace {

// A value of a type as a slot that any bytes may be put into.
class Probe {
   public:
    explicit Probe(const TypeInfo& type)
        : type_(type), slot_(type.make_slot(nullptr)), message_(type.length(*slot_)) {}

    const std::vector<std::uint8_t>& serialized(const std::vector<std::uint8_t>& value) {
        std::memcpy(const_cast<std::uint8_t*>(valueOf(type_, *slot_)), value.data(), value.size());
        type_.serialize(*slot_, message_.data(), static_cast<std::uint32_t>(message_.size()));
        return message_;
    }

   private:
    const TypeInfo& type_;
    std::shared_ptr<SlotHeader> slot_;
    std::vector<std::uint8_t> message_;
};

// @param marked which bytes are 1; the others are 0
template <typename Marked>
std::vector<std::uint8_t> pattern(std::size_t size, const Marked& marked) {
    std::vector<std::uint8_t> bytes(size);
    for (std::size_t i = 0; i < size; ++i) bytes[i] = marked(i) ? 1 : 0;
    return bytes;
}

// Which bytes of a value become which of its message: found by serialising values whose bytes tell
// their place. Of a type whose message is computed (a transform's quaternion) there is no answer.
bool findCopies(const TypeInfo& type, v1::FrameType& to) {
    Probe probe(type);
    const std::vector<std::uint8_t> zeros = probe.serialized(std::vector<std::uint8_t>(type.size));
    // Bit by bit, so that every byte is 0 or 1, which is a value of any type, a bool too.
    std::vector<std::size_t> place(zeros.size(), 0);
    std::vector<bool> varies(zeros.size(), false);
    const auto look = [&](const std::vector<std::uint8_t>& value, std::size_t adds) {
        const std::vector<std::uint8_t>& message = probe.serialized(value);
        for (std::size_t i = 0; i < message.size(); ++i) {
            if (message[i] == zeros[i]) continue;
            varies[i] = true;
            place[i] += adds;
        }
    };
    look(pattern(type.size, [](std::size_t) { return true; }), 0);
    for (std::size_t bit = 1; bit < type.size; bit *= 2)
        look(pattern(type.size, [bit](std::size_t i) { return (i & bit) != 0; }), bit);
    // And again as a whole.
    const std::vector<std::uint8_t> value =
        pattern(type.size, [](std::size_t i) { return i % 3 == 0 || i % 7 == 2; });
    const std::vector<std::uint8_t>& message = probe.serialized(value);
    for (std::size_t i = 0; i < message.size(); ++i) {
        if (place[i] >= type.size) return false;
        if (message[i] != (varies[i] ? value[place[i]] : zeros[i])) return false;
    }
    to.set_sample(zeros.data(), zeros.size());
    for (std::size_t i = 0; i < message.size(); ++i) {
        if (!varies[i]) continue;
        const int last = to.copies_size() - 1;
        if (last >= 0) {
            v1::FrameCopy& before = *to.mutable_copies(last);
            if (before.to() + before.size() == i && before.from() + before.size() == place[i]) {
                before.set_size(before.size() + 1);
                continue;
            }
        }
        v1::FrameCopy& copy = *to.add_copies();
        copy.set_from(static_cast<std::uint32_t>(place[i]));
        copy.set_to(static_cast<std::uint32_t>(i));
        copy.set_size(1);
    }
    return true;
}

v1::FrameType typeOf(const TypeInfo& type) {
    v1::FrameType to;
    to.set_ros_type(type.ros_type);
    to.set_ros_md5(type.ros_md5);
    to.set_ros_definition(type.ros_definition);
    to.set_computed(!findCopies(type, to));
    return to;
}

}  // namespace

std::string frameLayout(const FrameRing& ring, const std::vector<FrameColumn>& columns,
                        const std::vector<std::string>& notes) {
    v1::FrameLayout layout;
    std::map<const TypeInfo*, std::uint32_t> types;
    for (std::size_t i = 0; i < columns.size(); ++i) {
        const FrameColumn& from = columns[i];
        v1::FrameValue& value = *layout.add_values();
        value.set_component(from.component);
        value.set_name(from.name);
        value.set_type(from.type);
        value.set_unit(from.unit);
        value.set_mapped(from.mapped);
        value.set_offset(static_cast<std::uint32_t>(ring.offset(i)));
        value.set_size(static_cast<std::uint32_t>(from.size));
        if (from.output == nullptr) continue;
        const auto [known, is_new] =
            types.emplace(from.output, static_cast<std::uint32_t>(layout.types_size()) + 1);
        if (is_new) *layout.add_types() = typeOf(*from.output);
        value.set_output(known->second);
    }
    for (const std::string& note : notes) layout.add_notes(note);
    return layout.SerializeAsString();
}

}  // namespace rtcf::executor
