#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <sensor_msgs/JointState.h>

#include <rtcf/component.hpp>

#include "joint_names.hpp"
#include "joint_status.hpp"
#include "port_array.hpp"
#include "words.hpp"

namespace rtcf_control {
namespace {

class JointStatePublisher final : public rtcf::Component {
    // The longest text of a status without names of joints, with space to spare.
    static constexpr std::size_t kStatusSize = 64;

    using Inputs = Ports<rtcf::Input<double>, kMostJoints>;

    enum class Kind : std::int32_t { Unknown, Waiting, Complete, Missing, NotFinite };

    using Finding = JointFinding<Kind>;

    struct Setup {
        std::vector<std::string> joints;
    };

    std::array<Inputs, 3> in_{makePorts<rtcf::Input<double>, kMostJoints>(this, kQuantities[0]),
                              makePorts<rtcf::Input<double>, kMostJoints>(this, kQuantities[1]),
                              makePorts<rtcf::Input<double>, kMostJoints>(this, kQuantities[2])};
    rtcf::Output<sensor_msgs::JointState> state{this, "state", "", rtcf::Finite()};
    rtcf::Output<std::uint32_t> missing{this, "missing"};
    JointStatus<Kind> status_{this};

    rtcf::Parameter<std::string> joints{this, "joints", "joint1",
                                        rtcf::Doc("names of 1 to 16 joints"), rtcf::Fixed()};
    rtcf::Parameter<double> timeout{
        this,           "timeout",       std::numeric_limits<double>::infinity(),
        rtcf::Min(0.0), rtcf::Unit("s"), rtcf::Doc("age from which a value counts as missing")};
    rtcf::Derived<Setup> setup_{this};

    bool prepare(const rtcf::Values& proposed) override {
        Setup setup{words(proposed[joints])};
        if (const std::string why = jointsError(setup.joints); !why.empty()) return fail(why);
        setup_.stage(std::move(setup));
        return true;
    }

    bool configure() override {
        const std::size_t count = setup_->joints.size();
        sensor_msgs::JointState sample;
        sample.name = setup_->joints;
        sample.position.resize(count);
        sample.velocity.resize(count);
        sample.effort.resize(count);
        state.reserve(sample);
        status_.reserve(kStatusSize, setup_->joints);
        return true;
    }

    bool start() override {
        status_.begin();
        return true;
    }

    void update() override {
        sensor_msgs::JointState& message = state.value();
        const std::array<std::vector<double>*, 3> arrays{&message.position, &message.velocity,
                                                         &message.effort};
        Finding found{Kind::Waiting};
        std::uint32_t all_missing = 0;
        for (std::uint32_t quantity = 0; quantity < arrays.size(); ++quantity) {
            const Part part = read(in_[quantity], *arrays[quantity]);
            all_missing |= part.missing;
            if (!part.used) continue;
            // The first reason of all quantities; a missing value is more severe than NaN.
            if (part.missing != 0 && found.kind != Kind::Missing)
                found = {Kind::Missing, quantity, part.missing};
            if (part.not_finite != 0 && found.kind != Kind::Missing &&
                found.kind != Kind::NotFinite)
                found = {Kind::NotFinite, quantity, part.not_finite};
            if (found.kind == Kind::Waiting) found.kind = Kind::Complete;
        }
        const auto count = static_cast<std::uint32_t>(setup_->joints.size());
        missing.write(found.kind == Kind::Waiting
                          ? count
                          : static_cast<std::uint32_t>(__builtin_popcount(all_missing)));
        report(found);
        if (found.kind == Kind::Waiting || found.kind == Kind::Missing) return;
        message.header.stamp.fromNSec(
            static_cast<std::uint64_t>(std::max<std::int64_t>(stamp(), 0)));
        state.publish();  // NaN is rejected: readers keep the last message
    }

    // Runs in the last cycle, too, to publish its measured values.
    void safe() noexcept override { update(); }

    // One quantity of all joints.
    struct Part {
        bool used = false;  // a joint has a value of it
        std::uint32_t missing = 0;
        std::uint32_t not_finite = 0;
    };

    Part read(Inputs& inputs, std::vector<double>& values) {
        Part part;
        const std::size_t count = setup_->joints.size();
        values.resize(count);  // within the reserved capacity
        for (std::size_t i = 0; i < count; ++i) {
            rtcf::Input<double>& input = *inputs[i];
            const bool has_value = input.read() != rtcf::DataStatus::None;
            part.used = part.used || has_value;
            values[i] = input.value();
            if (!has_value || 1e-9 * static_cast<double>(input.age(this)) > timeout) {
                part.missing |= 1U << i;
            } else if (!std::isfinite(values[i])) {
                part.not_finite |= 1U << i;
            }
        }
        if (!part.used) {
            values.clear();
            part.missing = 0;
        }
        return part;
    }

    // Sets the status, and logs each one but the normal ones.
    void report(const Finding& found) {
        const std::string& text = status_.set(found, [&](std::string& to) { append(found, to); });
        if (found.kind == Kind::Missing || found.kind == Kind::NotFinite)
            RTCF_WARN_THROTTLE(this, 1.0, "state is not written: {}", text);
    }

    void append(const Finding& found, std::string& text) const {
        switch (found.kind) {
            case Kind::Unknown:
            case Kind::Waiting:
                text.append("waiting: no input has a value");
                break;
            case Kind::Complete:
                text.append("complete");
                break;
            case Kind::Missing:
            case Kind::NotFinite:
                text.append(found.kind == Kind::Missing ? "no " : "not finite: ");
                text.append(kQuantities[found.quantity]).append(" of ");
                appendNames(text, setup_->joints, found.joints);
                break;
        }
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::JointStatePublisher, "JointStatePublisher",
                     "Combines positions (rad or m), velocities and efforts of 1 to 16 joints into "
                     "sensor_msgs/JointState (as joint_state_controller of ros_control)",
                     JointStatePublisher)
