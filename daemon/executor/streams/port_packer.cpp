#include "streams/port_packer.hpp"

#include <cstring>

namespace rtcf::executor {

PortPacker::PortPacker(const FrameColumn& column, std::size_t offset)
    : column_(column), offset_(offset) {
    if (column.output == nullptr) return;
    slot_ = column.output->make_slot(nullptr);
    length_ = static_cast<std::uint32_t>(column.output->sample().size());
}

void PortPacker::pack(const std::uint8_t* values, std::string& to) const {
    const std::uint8_t* value = values + offset_;
    if (column_.output == nullptr) {
        to.append(reinterpret_cast<const char*>(value), column_.size);
        return;
    }
    std::memcpy(valueOf(*column_.output, *slot_), value, column_.size);
    const std::size_t before = to.size();
    to.resize(before + length_);
    column_.output->serialize(*slot_, reinterpret_cast<std::uint8_t*>(to.data() + before), length_);
}

}  // namespace rtcf::executor
