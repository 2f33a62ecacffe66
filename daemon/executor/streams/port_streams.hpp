/// @file
/// The streams of port values requested by rtcfd: frames from the loop's ring, packed by column.
/// Main thread only. Slow readers lose frames, and the stream contains the number of lost ones.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "rtcf/executor/v1/executor.pb.h"
#include "streams/port_windows.hpp"
#include "watch/frame_table.hpp"

namespace rtcf::executor {

class PortStreams {
   public:
    /// Numbers of the connection and the request.
    using Id = std::pair<std::uint64_t, std::uint64_t>;
    using Table = std::shared_ptr<const FrameTable>;
    /// True if the peer has room for more; false if its socket buffer is full or it has
    /// disconnected.
    using Room = std::function<bool(const Id& id)>;
    /// Sends a response.
    /// @return true if there is room for more
    using Send = std::function<bool(const Id& id, const v1::Response& response)>;

    static constexpr std::size_t kMost = 64;

    /// Begins a stream. It sends nothing before a table for `watch` arrives.
    /// @param min_max true = minima and maxima of each window of `every` cycles; false = each
    /// `every`-th cycle
    /// @throws Error if there are too many streams
    void begin(const Id& id, std::uint64_t watch, const Watch& wanted, std::uint32_t every,
               bool min_max);
    /// Ends a stream.
    /// @return the number of its watch; 0 = there is no such stream
    std::uint64_t end(const Id& id);
    /// Ends the streams of a connection.
    /// @return the numbers of their watches
    std::vector<std::uint64_t> endAll(std::uint64_t connection);

    /// Takes new tables, and sends new frames.
    /// @return unused tables, which the graph thread must release
    std::vector<Table> serve(const std::vector<Table>& tables, const Room& room, const Send& send);

   private:
    struct Stream {
        Stream(Id of, std::uint64_t number, Watch what, std::uint32_t step, bool extremes)
            : id(std::move(of)),
              watch(number),
              wanted(std::move(what)),
              every(step),
              min_max(extremes) {}

        Id id;
        std::uint64_t watch;
        Watch wanted;
        std::uint32_t every;
        bool min_max;
        std::deque<Table> tables;          // the first one is being read
        std::vector<std::size_t> columns;  // columns of the first table
        // Open window of minima and maxima; null = single cycles.
        std::unique_ptr<PortWindows> windows;
        bool begun = false;  // the first table has arrived
        bool schema_sent = false;
        std::uint64_t next = 0;  // next frame of the first table
        std::uint64_t lost = 0;  // lost cycles since the last batch

        // Cycles per sent value; lost cycles are counted in this unit.
        std::uint32_t step() const noexcept { return min_max ? 1 : every; }
    };

    void chooseColumns(Stream& stream);
    void serve(Stream& stream, const Send& send);
    void goOn(Stream& stream);
    void retire(Stream& stream);
    void noteTaken(FrameRing& ring) const;
    bool sendFrames(Stream& stream, const Send& send);
    bool sendWindows(Stream& stream, const Send& send);
    bool fill(Stream& stream, v1::Response& response, const std::vector<PortPacker>& packers,
              std::uint64_t end);
    v1::Response schemaOf(const Stream& stream) const;

    std::map<Id, Stream> streams_;
    std::vector<Table> retired_;
    Frame frame_;
};

}  // namespace rtcf::executor
