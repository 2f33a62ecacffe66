/// @file
/// A replay: the loop runs on the time of recorded messages. Each message is injected before the
/// first cycle whose time is not earlier. Outputs that would be published are collected after each
/// cycle. There is no other input and no clock of the machine, so the same graph, newly created,
/// gives the same outputs, bit by bit. Owned by OfflineRun; graph thread only.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bridge/bridge.hpp"
#include "loop/loop.hpp"
#include "runner/frame_keeper.hpp"

namespace rtcf::executor {

/// A topic of a recording and its ROS type.
struct RecordedTopic {
    std::string topic;
    std::string type;
    std::string md5;
    std::string definition;  ///< definition of the type; outputs only
};

struct RecordedMessage {
    std::string topic;
    std::int64_t time_ns = 0;
    std::string bytes;  ///< serialised
};

/// A piece of a replay.
struct ReplayChunk {
    bool begin = false;                 ///< begins a new replay, with new components
    std::int64_t start_ns = 0;          ///< with `begin`: time of the first cycle, ns since 1970
    std::vector<RecordedTopic> topics;  ///< with `begin`: topics of the recording
    std::vector<RecordedMessage> messages;  ///< in order of time; none after `until_ns`
    std::int64_t until_ns = 0;              ///< runs all cycles up to this time
    bool end = false;  ///< ends the replay, after a cycle that reads the last message
};

struct ReplayOutcome {
    std::uint64_t cycles = 0;  ///< cycles since the replay began
    std::size_t consumed = 0;  ///< number of consumed messages; the caller sends the others again
    /// Too many outputs for one answer: the caller asks again for the cycles up to `until_ns`.
    bool more = false;
    std::vector<RecordedMessage> outputs;
    std::vector<RecordedTopic> inputs;   ///< with `begin`: topics that components read
    std::vector<RecordedTopic> written;  ///< with `begin`: topics of the outputs
};

class Replay {
   public:
    /// @throws Error if a topic of the recording has another type than the input that reads it
    static void check(const BridgeTable& table, const std::vector<RecordedTopic>& topics);

    /// @param table table of the new components; no bridge serves it
    /// @param loop  has begun stepping at time `start_ns`; outlives this object
    Replay(BridgeTable table, Loop& loop, FrameKeeper& frames, std::int64_t start_ns);

    /// Lists the topics of inputs and outputs.
    void describe(ReplayOutcome& outcome) const;

    /// Runs cycles; fewer if the loop ends.
    ReplayOutcome run(const ReplayChunk& chunk);

    /// Discards outputs written since the last call.
    void discardOutputs();

   private:
    void inject(const RecordedMessage& message);
    std::size_t takeOutputs(std::vector<RecordedMessage>& outputs);

    BridgeTable table_;
    std::map<std::string, Injector*> injectors_;
    Loop& loop_;
    FrameKeeper& frames_;
    std::int64_t next_ns_;  // time of the next cycle
    std::uint64_t cycles_ = 0;
};

}  // namespace rtcf::executor
