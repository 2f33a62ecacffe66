#include "streams/port_streams.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "common/error.hpp"

namespace rtcf::executor {

namespace pb = ::rtcf::v1;

namespace {

// Approximate size of values in a batch, bytes.
constexpr std::size_t kLargestBatch = std::size_t{512} * 1024;
constexpr int kMostCycles = 4096;       // most cycles in a batch
constexpr std::size_t kMostTables = 8;  // most frame tables that a stream may be behind

std::vector<PortPacker> packersOf(const FrameTable& table,
                                  const std::vector<std::size_t>& columns) {
    std::vector<PortPacker> packers;
    packers.reserve(columns.size());
    for (const std::size_t column : columns)
        packers.emplace_back(table.columns[column], table.ring->offset(column));
    return packers;
}

// Skips frames that the writer is about to overwrite.
void skipGone(std::uint64_t& next, std::uint64_t& lost, const FrameRing& ring, std::uint32_t step) {
    const std::uint64_t kept = ring.capacity() - ring.capacity() / 8;
    const std::uint64_t waiting = ring.end() - next;
    if (waiting <= kept) return;
    const std::uint64_t gone = waiting - kept;
    lost += (gone + step - 1) / step;
    next += gone;
}

}  // namespace

void PortStreams::begin(const Id& id, std::uint64_t watch, const Watch& wanted, std::uint32_t every,
                        bool min_max) {
    if (streams_.size() >= kMost) {
        throw Error(ErrorKind::ResourceExhausted,
                    fmt::format("{} streams of ports are open, which is the limit: "
                                "end another one",
                                kMost));
    }
    streams_.try_emplace(id, id, watch, wanted, every == 0 ? 1 : every, min_max);
}

std::uint64_t PortStreams::end(const Id& id) {
    const auto found = streams_.find(id);
    if (found == streams_.end()) return 0;
    const std::uint64_t watch = found->second.watch;
    retire(found->second);
    streams_.erase(found);
    return watch;
}

std::vector<std::uint64_t> PortStreams::endAll(std::uint64_t connection) {
    std::vector<std::uint64_t> watches;
    for (auto each = streams_.begin(); each != streams_.end();) {
        if (each->first.first != connection) {
            ++each;
            continue;
        }
        watches.push_back(each->second.watch);
        retire(each->second);
        each = streams_.erase(each);
    }
    return watches;
}

void PortStreams::retire(Stream& stream) {
    for (Table& table : stream.tables) retired_.push_back(std::move(table));
}

std::vector<PortStreams::Table> PortStreams::serve(const std::vector<Table>& tables,
                                                   const Room& room, const Send& send) {
    std::vector<Id> ids;
    for (auto& [id, stream] : streams_) {
        for (const Table& table : tables) {
            if (table->watches.count(stream.watch) == 0) continue;
            stream.tables.push_back(table);
            // The reader has not read for long.
            if (stream.tables.size() > kMostTables) goOn(stream);
            if (stream.begun) continue;
            stream.begun = true;
            stream.next = table->ring->end();  // the ring may have frames of earlier watches
            chooseColumns(stream);
        }
        ids.push_back(id);
        if (!stream.tables.empty()) noteTaken(*stream.tables.front()->ring);
    }
    for (const Id& id : ids) {
        // Sending may end the streams of a disconnected peer.
        const auto found = streams_.find(id);
        if (found != streams_.end() && room(id)) serve(found->second, send);
    }
    for (const auto& [id, stream] : streams_) {
        if (!stream.tables.empty()) noteTaken(*stream.tables.front()->ring);
    }
    for (const Table& table : retired_) noteTaken(*table->ring);
    retired_.insert(retired_.end(), tables.begin(), tables.end());
    return std::exchange(retired_, {});
}

void PortStreams::noteTaken(FrameRing& ring) const {
    std::uint64_t taken = UINT64_MAX;
    for (const auto& [id, stream] : streams_) {
        if (!stream.tables.empty() && stream.tables.front()->ring.get() == &ring)
            taken = std::min(taken, stream.next);
    }
    ring.setTaken(taken);
}

void PortStreams::chooseColumns(Stream& stream) {
    const FrameTable& table = *stream.tables.front();
    stream.columns.clear();
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
        if (stream.wanted.selection.matches(table.columns[i].fullName()))
            stream.columns.push_back(i);
    }
    stream.schema_sent = false;
    stream.windows = stream.min_max
                         ? std::make_unique<PortWindows>(table, stream.columns, stream.every)
                         : nullptr;
}

void PortStreams::serve(Stream& stream, const Send& send) {
    const Id id = stream.id;  // a copy, as sending may destroy the stream
    while (!stream.tables.empty()) {
        if (!stream.schema_sent) {
            stream.schema_sent = true;
            const v1::Response schema = schemaOf(stream);
            if (!send(id, schema)) return;
        }
        if (!(stream.min_max ? sendWindows(stream, send) : sendFrames(stream, send))) return;
        if (stream.tables.size() == 1) return;
        if (stream.windows && stream.tables[1]->ring != stream.tables[0]->ring) {
            stream.windows->end();
            if (!sendWindows(stream, send)) return;
        }
        goOn(stream);
    }
}

// Moves a stream from its first table to the next one.
void PortStreams::goOn(Stream& stream) {
    retired_.push_back(std::move(stream.tables.front()));
    stream.tables.pop_front();
    const FrameRing& left = *retired_.back()->ring;
    if (stream.tables.front()->ring.get() == &left) return;
    stream.lost += (left.end() - stream.next + stream.step() - 1) / stream.step();
    if (stream.windows) stream.lost += stream.windows->count();
    stream.next = 0;
    chooseColumns(stream);
}

// Sends frames.
// @return true if all frames in the ring have been sent; if false, the stream may have been
// destroyed
bool PortStreams::sendFrames(Stream& stream, const Send& send) {
    const Id id = stream.id;
    const FrameTable& table = *stream.tables.front();
    const FrameRing& ring = *table.ring;
    const std::vector<PortPacker> packers = packersOf(table, stream.columns);
    std::size_t bytes_of_cycle = 64;
    for (const PortPacker& packer : packers) bytes_of_cycle += packer.length();
    if (stream.wanted.turns) bytes_of_cycle += table.turns.length();
    const std::uint64_t end = ring.end();
    while (stream.next < end) {
        skipGone(stream.next, stream.lost, ring, stream.step());
        v1::Response response;
        response.set_id(id.second);
        pb::PortBatch& batch = *response.mutable_ports()->mutable_batch();
        for (std::size_t i = 0; i < packers.size(); ++i) batch.add_values();
        std::uint64_t expected = 0;
        std::size_t bytes = 0;
        while (stream.next < end && batch.stamps_ns_size() < kMostCycles && bytes < kLargestBatch &&
               !batch.last_of_loop()) {
            if (!ring.read(stream.next, frame_)) {
                if (batch.stamps_ns_size() != 0) break;
                if (stream.next % stream.step() == 0) ++stream.lost;
                ++stream.next;
                continue;
            }
            const CycleRecord& cycle = frame_.cycle();
            if (cycle.iteration % stream.every != 0 && !frame_.lastOfLoop()) {
                ++stream.next;
                continue;
            }
            if (batch.stamps_ns_size() == 0) {
                batch.set_first_cycle(cycle.iteration);
            } else if (cycle.iteration != expected) {
                break;
            }
            expected = cycle.iteration + stream.every;
            batch.set_last_of_loop(frame_.lastOfLoop());
            batch.add_stamps_ns(cycle.stamp_ns);
            batch.add_latencies_ns(cycle.latency_ns);
            batch.add_durations_ns(cycle.duration_ns);
            for (std::size_t i = 0; i < packers.size(); ++i)
                packers[i].pack(frame_.values(), *batch.mutable_values(static_cast<int>(i)));
            if (stream.wanted.turns) table.turns.pack(frame_, *batch.mutable_turns());
            bytes += bytes_of_cycle;
            ++stream.next;
        }
        if (batch.stamps_ns_size() == 0) return true;
        batch.set_lost(std::exchange(stream.lost, 0));
        if (!send(id, response)) return false;
    }
    return true;
}

// Like sendFrames(), for minima and maxima. An incomplete window waits for more cycles.
bool PortStreams::sendWindows(Stream& stream, const Send& send) {
    const Id id = stream.id;
    const std::vector<PortPacker> packers = packersOf(*stream.tables.front(), stream.columns);
    const std::uint64_t end = stream.tables.front()->ring->end();
    for (;;) {
        v1::Response response;
        response.set_id(id.second);
        if (!fill(stream, response, packers, end)) return true;
        if (!send(id, response)) return false;
    }
}

// Fills a batch with windows.
// @return true if the batch contains a window
bool PortStreams::fill(Stream& stream, v1::Response& response,
                       const std::vector<PortPacker>& packers, std::uint64_t end) {
    const FrameRing& ring = *stream.tables.front()->ring;
    PortWindows& windows = *stream.windows;
    pb::PortBatch& batch = *response.mutable_ports()->mutable_batch();
    for (std::size_t i = 0; i < packers.size(); ++i) {
        batch.add_values();
        batch.add_places();
    }
    std::size_t bytes = 0;
    while (batch.counts_size() < kMostCycles && bytes < kLargestBatch && !batch.last_of_loop()) {
        if (windows.whole()) {
            const int before = batch.counts_size();
            if (before == 0) batch.set_first_cycle(windows.first());
            if (windows.first() !=
                batch.first_cycle() + static_cast<std::uint64_t>(before) * stream.every)
                break;
            bytes += windows.close(batch);
            continue;
        }
        if (stream.next >= end) break;
        skipGone(stream.next, stream.lost, ring, 1);
        if (!ring.read(stream.next, frame_)) {
            ++stream.next;
            ++stream.lost;
        } else if (windows.takes(frame_)) {
            windows.add(frame_, packers);
            ++stream.next;
        } else {
            windows.end();
        }
    }
    if (batch.counts_size() == 0) return false;
    batch.set_lost(std::exchange(stream.lost, 0));
    return true;
}

v1::Response PortStreams::schemaOf(const Stream& stream) const {
    v1::Response response;
    response.set_id(stream.id.second);
    const FrameTable& table = *stream.tables.front();
    pb::PortSchema& schema = *response.mutable_ports()->mutable_schema();
    for (const std::string& note : table.notes) schema.add_notes(note);
    if (stream.wanted.turns) {
        for (const std::string& component : table.turns.components()) schema.add_turns(component);
    }
    for (const std::size_t index : stream.columns) {
        const FrameColumn& from = table.columns[index];
        pb::PortColumn& column = *schema.add_columns();
        column.set_component(from.component);
        column.set_name(from.name);
        column.set_kind(from.output != nullptr ? pb::PortColumn::KIND_OUTPUT
                                               : pb::PortColumn::KIND_STATE);
        column.set_type(from.type);
        column.set_unit(from.unit);
        column.set_mapped(from.mapped);
        column.set_size(static_cast<std::uint32_t>(from.size));
        if (from.output == nullptr) continue;
        column.set_ros_type(from.output->ros_type);
        column.set_ros_md5(from.output->ros_md5);
        column.set_ros_definition(from.output->ros_definition);
        column.set_sample(from.output->sample());
        column.set_size(static_cast<std::uint32_t>(column.sample().size()));
    }
    return response;
}

}  // namespace rtcf::executor
