/// @file
/// A replay: the loop runs on the time of recorded messages, each injected
/// before the first cycle whose time is not before it, and what the loop would
/// publish is taken out after each cycle. Nothing else comes in and no clock of
/// the machine is looked at, so that the same graph, anew, gives the same
/// outputs bit by bit. Owned by the runner; graph thread only.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bridge/bridge.hpp"
#include "loop/loop.hpp"

namespace rtcf::executor {

/// A topic and its ROS type, as a recording names them.
struct RecordedTopic {
    std::string topic;
    std::string type;
    std::string md5;
    std::string definition;  ///< text of the type; of outputs only
};

struct RecordedMessage {
    std::string topic;
    std::int64_t time_ns = 0;
    std::string bytes;  ///< serialised
};

/// A piece of a replay.
struct ReplayChunk {
    bool begin = false;                     ///< of a new replay, with components made anew
    std::int64_t start_ns = 0;              ///< with `begin`: time of the first cycle
    std::vector<RecordedTopic> topics;      ///< with `begin`: of the recording
    std::vector<RecordedMessage> messages;  ///< in order of their times, none after `until_ns`
    std::int64_t until_ns = 0;              ///< all cycles up to this time are to be run
    bool end = false;                       ///< of the replay
};

struct ReplayOutcome {
    std::uint64_t cycles = 0;  ///< since the replay began
    std::size_t consumed = 0;  ///< of the chunk's messages; the others come again with the next
    bool more = false;         ///< outputs are many: ask again for the cycles up to `until_ns`
    std::vector<RecordedMessage> outputs;
    std::vector<RecordedTopic> inputs;   ///< with `begin`: topics that components read
    std::vector<RecordedTopic> written;  ///< with `begin`: topics of the outputs
};

class Replay {
   public:
    /// @throws Refusal if a topic of the recording has another type than the input that reads it
    static void check(const BridgeTable& table, const std::vector<RecordedTopic>& topics);

    /// @param table of the components made anew, served by nobody else
    /// @param loop  that has begun stepping, at time `start_ns`; outlives this
    Replay(BridgeTable table, Loop& loop, std::int64_t start_ns);

    /// Topics that the replay can inject and those it takes out.
    void describe(ReplayOutcome& outcome) const;

    /// Runs cycles; fewer if the loop ends.
    ReplayOutcome run(const ReplayChunk& chunk);

    /// Forgets what was written since.
    void discardOutputs();

   private:
    void inject(const RecordedMessage& message);
    std::size_t takeOutputs(std::vector<RecordedMessage>& outputs);

    BridgeTable table_;
    std::map<std::string, Injector*> injectors_;
    Loop& loop_;
    std::int64_t next_ns_;  // time of the next cycle
    std::uint64_t cycles_ = 0;
};

}  // namespace rtcf::executor
