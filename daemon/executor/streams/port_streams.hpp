/// @file
/// The streams of ports' values that rtcfd has asked for: frames out of the loop's ring, packed
/// column by column. Main thread only. A peer that does not read loses frames and is told how many.
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
    /// Of connection and request.
    using Id = std::pair<std::uint64_t, std::uint64_t>;
    using Table = std::shared_ptr<const FrameTable>;
    /// Whether the peer has room for more; not if it has enough to read for now, or has gone.
    using Room = std::function<bool(const Id& id)>;
    /// Takes what is to be sent. @return whether there is room for more
    using Send = std::function<bool(const Id& id, const v1::Response& response)>;

    static constexpr std::size_t kMost = 64;

    /// Begins a stream; it is silent until a table is for `watch`.
    /// @param min_max minima and maxima of each window of `every` cycles, not each `every`-th cycle
    /// @throws Refusal if there are too many
    void begin(const Id& id, std::uint64_t watch, const PortSelection& selection,
               std::uint32_t every, bool min_max);
    /// @return the number of its watch; 0 = there is no such stream
    std::uint64_t end(const Id& id);
    /// Ends those of a connection. @return the numbers of their watches
    std::vector<std::uint64_t> endAll(std::uint64_t connection);

    /// Takes new tables, packs what has come since, and sends it. @return tables that nobody needs
    /// any more, to be let go of on the graph thread
    std::vector<Table> serve(const std::vector<Table>& tables, const Room& room, const Send& send);

   private:
    struct Stream {
        Stream(Id of, std::uint64_t number, PortSelection chosen, std::uint32_t step, bool extremes)
            : id(std::move(of)),
              watch(number),
              selection(std::move(chosen)),
              every(step),
              min_max(extremes) {}

        Id id;
        std::uint64_t watch;
        PortSelection selection;
        std::uint32_t every;
        bool min_max;
        std::deque<Table> tables;              // the first one is being read
        std::vector<std::size_t> columns;      // of it
        std::unique_ptr<PortWindows> windows;  // of minima and maxima; null = of each cycle
        bool begun = false;                    // the first one has come
        bool told = false;                     // its schema
        std::uint64_t next = 0;                // frame of it
        std::uint64_t lost = 0;                // cycles, since the last batch

        // Of so many cycles one is told, or would be: lost ones are counted like this.
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
