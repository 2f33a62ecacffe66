/// @file
/// An image of a runner: all that its next cycle depends on, as a value, by the names and types
/// of what holds it. Restored into a runner with the same graph, whoever built its libraries and
/// whenever, the loop goes on with the same values, bit by bit, as far as components declare what
/// they remember. How it stands in a file: messages/image_file.hpp.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rtcf/parameter.hpp"
#include "state/image_work.hpp"

namespace rtcf::executor {

/// A port's type, as connections compare it.
struct ImageType {
    std::string name;
    std::string md5;
    std::uint64_t size = 0;
    std::uint64_t alignment = 0;
    bool flat = false;
};
ImageType imageTypeOf(const TypeInfo& type);
/// @return whether values of the one are values of the other
bool same(const ImageType& image, const TypeInfo& type);

struct ImageValue {
    std::uint64_t sequence = 0;
    std::int64_t time_ns = 0;
    std::string bytes;  ///< of a flat type: as they lie in memory; else serialised
};

struct ImageState {
    std::string name;
    std::string type;  ///< for people
    std::uint64_t identity = 0;
    std::string bytes;
};

struct ImageOutput {
    std::string name;
    ImageType type;
    ImageValue value;
    std::optional<ImageValue> staged;   ///< written and not let pass, if it is staged
    std::optional<ImageValue> latched;  ///< what loop breaks have of it
};

struct ImageInput {
    std::string name;
    ImageType type;
    std::string source;  ///< what feeds it, e.g. "/C.out"; empty = nothing
    std::uint64_t seen = 0;
    bool reads_source = true;        ///< its component has the source's value,
    std::string kept_of;             ///< or that of an output that fed it earlier,
    std::optional<ImageValue> kept;  ///< or one of what has gone; none of these: none
    bool kept_is_new = false;        ///< it has not read that yet
    std::optional<ImageValue> left;  ///< with nothing that feeds it: the source's last value
};

struct ImageComponent {
    std::string name;  ///< full
    std::string package;
    std::string type;
    std::uint32_t every = 1;
    std::uint32_t phase = 0;
    std::int64_t updated_ns = -1;  ///< see ComponentContext
    std::int64_t elapsed_ns = 0;
    std::vector<std::pair<std::string, ParameterValue>> parameters;
    std::vector<ImageState> states;
    std::vector<ImageOutput> outputs;
    std::vector<ImageInput> inputs;
};

/// The last value that came from outside on a topic.
struct ImageTopic {
    std::string name;
    ImageType type;
    std::uint64_t sequence = 0;
    ImageValue value;
};

struct RunnerImage {
    std::string runner;
    std::int64_t taken_ns = 0;  ///< CLOCK_REALTIME
    std::int64_t period_ns = 0;
    ClockImage clock;
    std::vector<ImageComponent> components;  ///< in the order of the schedule
    std::vector<ImageTopic> topics;
};

}  // namespace rtcf::executor
