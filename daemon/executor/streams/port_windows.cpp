#include "streams/port_windows.hpp"

#include <algorithm>
#include <stdexcept>

namespace rtcf::executor {

namespace {

std::vector<NumberField> numbersOf(const FrameColumn& column) {
    if (column.output == nullptr) return numbersOfState(column.type, column.size);
    try {
        return numbersOfMessage(column.output->ros_definition, column.output->sample());
    } catch (const std::invalid_argument&) {
        return {};  // clients cannot parse such a message either
    }
}

}  // namespace

PortWindows::PortWindows(const FrameTable& table, const std::vector<std::size_t>& columns,
                         std::uint32_t every)
    : every_(every) {
    for (const std::size_t column : columns) {
        extremes_.emplace_back(numbersOf(table.columns[column]));
        bytes_ += extremes_.back().bytes(table.columns[column].size);
    }
}

bool PortWindows::takes(const Frame& frame) const noexcept {
    const std::uint64_t cycle = frame.cycle().iteration;
    // A restarted loop counts its cycles anew, so its cycles do not belong to the window.
    return count_ == 0 || (cycle > latest_ && cycle - cycle % every_ == first_);
}

void PortWindows::add(const Frame& frame, const std::vector<PortPacker>& packers) {
    const CycleRecord& cycle = frame.cycle();
    const auto place = static_cast<std::uint32_t>(cycle.iteration % every_);
    if (count_ == 0) {
        first_ = cycle.iteration - place;
        earliest_ = cycle.iteration;
        stamp_ns_ = cycle.stamp_ns;
        latency_ns_ = cycle.latency_ns;
        duration_ns_ = cycle.duration_ns;
    }
    ++count_;
    latest_ = cycle.iteration;
    latency_ns_ = std::max(latency_ns_, cycle.latency_ns);
    duration_ns_ = std::max(duration_ns_, cycle.duration_ns);
    last_of_loop_ = frame.lastOfLoop();
    whole_ = last_of_loop_ || place == every_ - 1;
    for (std::size_t i = 0; i < extremes_.size(); ++i) {
        value_.clear();
        packers[i].pack(frame.values(), value_);
        extremes_[i].add(value_, place);
    }
}

std::size_t PortWindows::close(::rtcf::v1::PortBatch& batch) {
    batch.set_last_of_loop(last_of_loop_);
    batch.add_stamps_ns(stamp_ns_);
    batch.add_latencies_ns(latency_ns_);
    batch.add_durations_ns(duration_ns_);
    batch.add_counts(count_);
    batch.add_begins(static_cast<std::uint32_t>(earliest_ - first_));
    batch.add_ends(static_cast<std::uint32_t>(latest_ - first_));
    for (std::size_t i = 0; i < extremes_.size(); ++i)
        extremes_[i].take(*batch.mutable_values(static_cast<int>(i)),
                          *batch.mutable_places(static_cast<int>(i)));
    count_ = 0;
    whole_ = last_of_loop_ = false;
    return bytes_;
}

}  // namespace rtcf::executor
