#include "runner/replay.hpp"

#include <fmt/format.h>

#include "common/error.hpp"

namespace rtcf::executor {

namespace {

// Limits of one answer, which must fit into one message on the socket.
constexpr std::size_t kMaxOutputBytes = 4 * 1024 * 1024;
constexpr std::size_t kMaxOutputs = 20'000;

RecordedTopic topicOf(const std::string& topic, const TypeInfo& type) {
    return {topic, type.ros_type, type.ros_md5, type.ros_definition};
}

}  // namespace

void Replay::check(const BridgeTable& table, const std::vector<RecordedTopic>& topics) {
    for (const auto& injector : table.inputs) {
        for (const RecordedTopic& recorded : topics) {
            if (recorded.topic != injector->topic() || recorded.md5 == injector->type().ros_md5)
                continue;
            throw Error(
                ErrorKind::RecordingInvalid,
                fmt::format(
                    "{} is recorded as {} (MD5 {}), but its reader has type {} (MD5 {}): replay "
                    "without that topic, or remap the input",
                    recorded.topic, recorded.type, recorded.md5, injector->type().ros_type,
                    injector->type().ros_md5));
        }
    }
}

Replay::Replay(BridgeTable table, Loop& loop, FrameKeeper& frames, std::int64_t start_ns)
    : table_(std::move(table)), loop_(loop), frames_(frames), next_ns_(start_ns) {
    for (const auto& injector : table_.inputs) injectors_[injector->topic()] = injector.get();
}

void Replay::describe(ReplayOutcome& outcome) const {
    for (const auto& injector : table_.inputs)
        outcome.inputs.push_back(topicOf(injector->topic(), injector->type()));
    for (const auto& tap : table_.outputs)
        outcome.written.push_back(topicOf(tap->topic(), tap->type()));
}

ReplayOutcome Replay::run(const ReplayChunk& chunk) {
    ReplayOutcome outcome;
    std::size_t bytes = 0;
    // The last cycle is the first one that is not before the last message.
    const auto unread = [&] { return outcome.consumed < chunk.messages.size(); };
    while (next_ns_ <= chunk.until_ns || (chunk.end && unread())) {
        if (bytes > kMaxOutputBytes || outcome.outputs.size() > kMaxOutputs) {
            outcome.more = true;
            break;
        }
        for (; unread(); ++outcome.consumed) {
            const RecordedMessage& message = chunk.messages[outcome.consumed];
            if (message.time_ns > next_ns_) break;
            inject(message);
        }
        if (!frames_.stepOnce()) break;
        bytes += takeOutputs(outcome.outputs);
        ++cycles_;
        next_ns_ += loop_.clock().period_ns;
    }
    outcome.cycles = cycles_;
    return outcome;
}

void Replay::inject(const RecordedMessage& message) {
    const auto found = injectors_.find(message.topic);
    if (found == injectors_.end()) return;  // no component reads the topic
    if (found->second->deliver(reinterpret_cast<const std::uint8_t*>(message.bytes.data()),
                               static_cast<std::uint32_t>(message.bytes.size())))
        return;
    throw Error(ErrorKind::RecordingInvalid,
                fmt::format("a message of {} at {:.9f} s is not of type {}: is the recording "
                            "damaged?",
                            message.topic, static_cast<double>(message.time_ns) / 1e9,
                            found->second->type().ros_type));
}

std::size_t Replay::takeOutputs(std::vector<RecordedMessage>& outputs) {
    std::size_t bytes = 0;
    for (const auto& tap : table_.outputs) {
        while (
            tap->pop([&](const std::uint8_t* data, std::uint32_t size, std::int64_t /*stamp_ns*/) {
                outputs.push_back({tap->topic(), next_ns_,
                                   std::string(reinterpret_cast<const char*>(data), size)});
                bytes += size;
            })) {
        }
    }
    return bytes;
}

void Replay::discardOutputs() {
    std::vector<RecordedMessage> outputs;
    takeOutputs(outputs);
}

}  // namespace rtcf::executor
