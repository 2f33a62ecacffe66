/// @file
/// A snapshot of a runner: all values that its next cycle depends on, by the names and types of
/// their components and ports. If a snapshot is restored into a runner with the same graph, even
/// with rebuilt libraries, the loop continues with the same values, bit by bit, provided that
/// components declare all their state. File format: messages/snapshot_file.hpp.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtcf/parameter.hpp"
#include "state/snapshot_work.hpp"

namespace rtcf::executor {

/// A port's type, with the properties that connections compare.
struct SnapshotType {
    std::string name;
    std::string md5;
    std::uint64_t size = 0;
    std::uint64_t alignment = 0;
    bool flat = false;
};
SnapshotType snapshotTypeOf(const TypeInfo& type);
/// @return true if values of the two types are compatible
bool same(const SnapshotType& saved, const TypeInfo& type);

struct SnapshotValue {
    std::int64_t stamp = 0;  ///< loop time of the write, ns; 0 = never written
    std::string bytes;       ///< flat types: as in memory; others: serialised
};

struct SnapshotState {
    std::string name;
    std::string type;  ///< type for people
    std::uint64_t identity = 0;
    std::string bytes;
};

struct SnapshotOutput {
    std::string name;
    SnapshotType type;
    SnapshotValue value;
    std::optional<SnapshotValue> staged;   ///< staged outputs only: the value before commit()
    std::optional<SnapshotValue> latched;  ///< the copy that loop breaks read
};

struct SnapshotInput {
    std::string name;
    SnapshotType type;
    std::string source;     ///< its writer, e.g. "/C.out"; empty = none
    std::int64_t seen = 0;  ///< stamp of the value of the last read
    /// The value of a removed writer, until the present one writes; unset = the present one's.
    std::optional<SnapshotValue> held;
};

struct SnapshotComponent {
    std::string name;  ///< full name
    std::string package;
    std::string type;
    std::uint32_t every = 1;
    std::uint32_t phase = 0;
    std::int64_t updated_ns = -1;  ///< see ComponentContext
    std::int64_t elapsed_ns = 0;
    std::vector<std::pair<std::string, ParameterValue>> parameters;
    std::vector<SnapshotState> states;
    std::vector<SnapshotOutput> outputs;
    std::vector<SnapshotInput> inputs;
};

/// The last value from outside on a topic.
struct SnapshotTopic {
    std::string name;
    SnapshotType type;
    SnapshotValue value;
};

struct Snapshot {
    std::string runner;
    std::int64_t taken_ns = 0;  ///< CLOCK_REALTIME
    std::int64_t period_ns = 0;
    ClockState clock;
    std::vector<SnapshotComponent> components;  ///< in the order of the schedule
    std::vector<SnapshotTopic> topics;
};

}  // namespace rtcf::executor
