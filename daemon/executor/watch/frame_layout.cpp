#include "watch/frame_layout.hpp"

#include <map>

#include "common/serialized.hpp"
#include "rtcf/executor/v1/executor.pb.h"

namespace rtcf::executor {

namespace {

v1::FrameType typeOf(const TypeInfo& type) {
    v1::FrameType to;
    to.set_ros_type(type.ros_type);
    to.set_ros_md5(type.ros_md5);
    to.set_ros_definition(type.ros_definition);
    to.set_sample(type.sample());
    const ByteCopies copies = type.copies();
    to.set_computed(!copies);
    if (!copies) return to;
    for (const ByteCopy& from : *copies) {
        v1::FrameCopy& copy = *to.add_copies();
        copy.set_from(from.from);
        copy.set_to(from.to);
        copy.set_size(from.size);
    }
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
    layout.set_steps(static_cast<std::uint32_t>(ring.steps()));
    layout.set_ns_per_tick(ring.counter().nsPerTick());
    return serialized(layout);
}

}  // namespace rtcf::executor
