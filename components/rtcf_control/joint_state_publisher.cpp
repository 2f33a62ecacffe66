#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <sensor_msgs/JointState.h>
#include <std_msgs/String.h>

#include <rtcf/component.hpp>

#include "joint_names.hpp"
#include "port_array.hpp"

namespace rtcf_control {
namespace {

class JointStatePublisher final : public rtcf::Component {
    static constexpr std::array<const char*, 3> kQuantities{"position", "velocity", "effort"};
    // The longest text of a status without names of joints, with space to spare.
    static constexpr std::size_t kStatusSize = 64;

    using Inputs = Ports<rtcf::Input<double>, kMostJoints>;

    enum class Kind : std::int32_t { Unknown, Waiting, Complete, Missing, NotFinite };

    // What a status is about.
    struct Finding {
        Kind kind = Kind::Unknown;
        std::uint32_t quantity = 0;
        std::uint32_t joints = 0;  // bit i is joint i

        bool operator!=(const Finding& other) const {
            return kind != other.kind || quantity != other.quantity || joints != other.joints;
        }
        template <typename Visit>
        void fields(Visit&& visit) {
            visit("kind", kind);
            visit("quantity", quantity);
            visit("joints", joints);
        }
    };

    struct Setup {
        std::vector<std::string> joints;
    };

    std::array<Inputs, 3> in_{makePorts<rtcf::Input<double>, kMostJoints>(this, kQuantities[0]),
                              makePorts<rtcf::Input<double>, kMostJoints>(this, kQuantities[1]),
                              makePorts<rtcf::Input<double>, kMostJoints>(this, kQuantities[2])};
    rtcf::Output<sensor_msgs::JointState> state{this, "state", "", rtcf::Finite()};
    rtcf::Output<std::uint32_t> missing{this, "missing"};
    rtcf::Output<std_msgs::String> status{this, "status"};

    rtcf::Parameter<std::string> joints{this, "joints", "joint1",
                                        rtcf::Doc("names of 1 to 16 joints; fixed after the load")};
    rtcf::Parameter<double> timeout{
        this,           "timeout",       std::numeric_limits<double>::infinity(),
        rtcf::Min(0.0), rtcf::Unit("s"), rtcf::Doc("age from which a value counts as missing")};
    rtcf::Derived<Setup> setup_{this};

    rtcf::State<Finding> finding_{this, "finding", {}, rtcf::Doc("reason of the status")};

    bool configured_ = false;

    bool prepare(const rtcf::Values& proposed) override {
        Setup setup{words(proposed[joints])};
        if (const std::string why = jointsError(setup.joints); !why.empty()) return fail(why);
        if (configured_ && setup.joints != setup_->joints)
            return fail("joints cannot change after the load; unload the component and load it");
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
        std_msgs::String text;
        text.data.resize(kStatusSize + namesSize(setup_->joints));
        status.reserve(text);
        configured_ = true;
        return true;
    }

    void cleanup() override { configured_ = false; }

    bool start() override {
        finding_ = Finding{};
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
        state.publish();  // NaN is rejected by the check: readers keep the last message
    }

    // In the last cycle as in any other: the measured values are as they are.
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
            if (!has_value || 1e-9 * static_cast<double>(input.age()) > timeout) {
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

    // Writes a status that differs from the last one, and logs each one but the normal ones.
    void report(const Finding& found) {
        std::string& text = status.value().data;
        if (found != finding_.value()) {
            finding_ = found;
            text.clear();
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
            status.publish();
        }
        if (found.kind == Kind::Missing || found.kind == Kind::NotFinite)
            RTCF_WARN_THROTTLE(this, 1.0, "state is not written: {}", text);
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::JointStatePublisher, "JointStatePublisher",
                     "Combines positions (rad or m), velocities and efforts of 1 to 16 joints into "
                     "sensor_msgs/JointState (as joint_state_controller of ros_control)",
                     JointStatePublisher)
