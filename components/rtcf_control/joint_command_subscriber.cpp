#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
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

class JointCommandSubscriber final : public rtcf::Component {
    // The longest text of a status without names of joints, with space to spare.
    static constexpr std::size_t kStatusSize = 96;

    using Outputs = Ports<rtcf::Output<double>, kMostJoints>;

    enum class Incomplete { Reject, Accept };

    enum class Kind : std::int32_t {
        Unknown,
        Waiting,
        Accepted,  // perhaps without some joints
        TooManyNames,
        Twice,
        Missing,
        Size,
        Empty,
        NotFinite
    };

    using Finding = JointFinding<Kind>;

    struct Setup {
        std::vector<std::string> joints;
    };

    rtcf::Input<sensor_msgs::JointState> command{this, "command"};
    std::array<Outputs, 3> out_{makeOutputs(0), makeOutputs(1), makeOutputs(2)};
    rtcf::Output<std::uint32_t> missing{this, "missing"};
    rtcf::Output<std::uint32_t> rejected{this, "rejected"};
    JointStatus<Kind> status_{this};

    rtcf::Parameter<std::string> joints{this, "joints", "joint1",
                                        rtcf::Doc("names of 1 to 16 joints"), rtcf::Fixed()};
    rtcf::Parameter<Incomplete> incomplete{
        this,
        "incomplete",
        Incomplete::Reject,
        rtcf::Choice("reject", Incomplete::Reject),
        rtcf::Choice("accept", Incomplete::Accept),
        rtcf::Doc("a message without some of the joints: reject it, or use it for the others")};
    rtcf::Derived<Setup> setup_{this};

    rtcf::State<std::uint32_t> rejected_{this, "rejections", 0,
                                         rtcf::Doc("number of rejected messages")};

    Outputs makeOutputs(std::size_t quantity) {
        return makePorts<rtcf::Output<double>, kMostJoints>(this, kQuantities[quantity],
                                                            std::string(), rtcf::Finite());
    }

    bool prepare(const rtcf::Values& proposed) override {
        Setup setup{words(proposed[joints])};
        if (const std::string why = jointsError(setup.joints); !why.empty()) return fail(why);
        setup_.stage(std::move(setup));
        return true;
    }

    bool configure() override {
        status_.reserve(kStatusSize, setup_->joints);
        return true;
    }

    bool start() override {
        status_.begin();
        rejected_ = 0;
        return true;
    }

    void update() override {
        switch (command.read()) {
            case rtcf::DataStatus::None:
                missing.write(static_cast<std::uint32_t>(setup_->joints.size()));
                report({Kind::Waiting});
                break;
            case rtcf::DataStatus::New:
                follow(command.value());
                break;
            case rtcf::DataStatus::Old:
                break;  // each value is written once, so that readers know its age
        }
        rejected.write(rejected_);
    }

    // Runs in the last cycle, too, to pass on the safe command of an upstream component.
    void safe() noexcept override { update(); }

    void follow(const sensor_msgs::JointState& message) {
        JointPlaces places;
        const Finding found = examine(message, places);
        missing.write(static_cast<std::uint32_t>(__builtin_popcount(places.missing())));
        report(found);
        if (found.kind != Kind::Accepted) {
            ++rejected_;
            return;
        }
        const auto arrays = arraysOf(message);
        for (std::size_t quantity = 0; quantity < arrays.size(); ++quantity) {
            if (arrays[quantity]->empty()) continue;
            for (std::size_t i = 0; i < setup_->joints.size(); ++i) {
                if (places[i] != JointPlaces::kAbsent)
                    out_[quantity][i]->write((*arrays[quantity])[places[i]]);
            }
        }
    }

    static std::array<const std::vector<double>*, 3> arraysOf(
        const sensor_msgs::JointState& message) {
        return {&message.position, &message.velocity, &message.effort};
    }

    // Checks the whole message: it is used as a whole, or not at all.
    Finding examine(const sensor_msgs::JointState& message, JointPlaces& places) const {
        const std::size_t count = setup_->joints.size();
        if (message.name.size() > kMostNames) return {Kind::TooManyNames};
        if (const std::size_t twice = places.find(message.name, setup_->joints); twice < count)
            return {Kind::Twice, 0, 1U << twice};
        const std::uint32_t lacking = places.missing();
        const bool none = lacking == (1U << count) - 1U;
        if (none || (lacking != 0 && incomplete == Incomplete::Reject))
            return {Kind::Missing, 0, lacking};
        const std::size_t size = message.name.empty() ? count : message.name.size();
        const auto arrays = arraysOf(message);
        bool empty = true;
        for (std::uint32_t quantity = 0; quantity < arrays.size(); ++quantity) {
            const std::vector<double>& values = *arrays[quantity];
            if (values.empty()) continue;
            empty = false;
            if (values.size() != size) return {Kind::Size, quantity};
            for (std::size_t i = 0; i < count; ++i) {
                if (places[i] != JointPlaces::kAbsent && !std::isfinite(values[places[i]]))
                    return {Kind::NotFinite, quantity, 1U << i};
            }
        }
        if (empty) return {Kind::Empty};
        return {Kind::Accepted, 0, lacking};
    }

    // Sets the status, and logs each one but the normal ones.
    void report(const Finding& found) {
        const std::string& text = status_.set(found, [&](std::string& to) { append(found, to); });
        if (found.kind != Kind::Waiting && (found.kind != Kind::Accepted || found.joints != 0))
            RTCF_WARN_THROTTLE(this, 1.0, "command {}", text);
    }

    void append(const Finding& found, std::string& text) const {
        const char* const quantity = kQuantities[found.quantity];
        switch (found.kind) {
            case Kind::Unknown:
            case Kind::Waiting:
                text.append("waiting: no message yet");
                return;
            case Kind::Accepted:
                text.append(found.joints == 0 ? "accepted" : "accepted without ");
                break;
            case Kind::TooManyNames:
                text.append("rejected: it has more than 1024 names");
                static_assert(kMostNames == 1024);
                break;
            case Kind::Twice:
                text.append("rejected: twice in it: ");
                break;
            case Kind::Missing:
                text.append("rejected: missing in it: ");
                break;
            case Kind::Size:
                text.append("rejected: it does not have one ").append(quantity);
                text.append(" of each joint");
                break;
            case Kind::Empty:
                text.append("rejected: it has no position, velocity or effort");
                break;
            case Kind::NotFinite:
                text.append("rejected: not finite: ").append(quantity).append(" of ");
                break;
        }
        appendNames(text, setup_->joints, found.joints);
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::JointCommandSubscriber, "JointCommandSubscriber",
                     "Splits sensor_msgs/JointState into positions (rad or m), velocities and "
                     "efforts of 1 to 16 joints by name, and rejects messages that do not fit",
                     JointCommandSubscriber)
