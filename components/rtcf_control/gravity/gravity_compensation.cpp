#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sensor_msgs/JointState.h>

#include <rtcf/component.hpp>
#include <rtcf/ros.hpp>

#include "gravity/robot_chain.hpp"
#include "joint_names.hpp"
#include "measurement_watch.hpp"
#include "words.hpp"

namespace rtcf_control {
namespace {

class GravityCompensation final : public rtcf::Component {
    // Bytes of a URDF.
    static constexpr std::size_t kLargestText = 16U << 20U;

    using Strings = std::vector<std::string>;

    // A robot and its joints as numbers, to find out whether state belongs to it.
    struct Identity {
        std::uint64_t robot = 0;
        std::uint64_t joints = 0;
        template <typename Visit>
        void fields(Visit&& visit) {
            visit("robot", robot);
            visit("joints", joints);
        }
    };

    struct Law {
        std::array<double, 3> gravity{};
        double share = 0.0;
        bool operator!=(const Law& other) const {
            return gravity != other.gravity || share != other.share;
        }
        template <typename Visit>
        void fields(Visit&& visit) {
            visit("gravity", gravity);
            visit("share", share);
        }
    };

    // The parameters that are fixed after the load.
    struct Setup {
        std::string urdf;
        std::string description;
        RobotChain::Selection selection;
    };

    rtcf::Input<sensor_msgs::JointState> measured{this, "measured"};
    rtcf::Output<sensor_msgs::JointState> command{this, "command", "", rtcf::Finite()};
    rtcf::Output<std::uint32_t> rejected{this, "rejected"};

    rtcf::Parameter<std::string> urdf{
        this, "urdf", "",
        rtcf::Doc("path of the robot's URDF, or its text; empty: the ROS parameter that "
                  "description names"),
        rtcf::Fixed()};
    rtcf::Parameter<std::string> description{this, "description", "robot_description",
                                             rtcf::Doc("ROS parameter with the text of the URDF"),
                                             rtcf::Fixed()};
    rtcf::Parameter<std::string> base{this, "base", "",
                                      rtcf::Doc("link at which the chain begins; empty: the root"),
                                      rtcf::Fixed()};
    rtcf::Parameter<std::string> tip{
        this, "tip", "",
        rtcf::Doc("link at which the chain ends; empty: the end of a robot that does not branch, "
                  "or the link of the last joint"),
        rtcf::Fixed()};
    rtcf::Parameter<std::string> joints{
        this, "joints", "",
        rtcf::Doc("names of all moving joints from base to tip, at most 16, in the order of the "
                  "output; empty: the order of the chain"),
        rtcf::Fixed()};
    rtcf::Parameter<double> gravity_x{
        this, "gravity_x", 0.0, rtcf::Unit("m/s^2"),
        rtcf::Doc("acceleration of gravity along the x axis of the base")};
    rtcf::Parameter<double> gravity_y{
        this, "gravity_y", 0.0, rtcf::Unit("m/s^2"),
        rtcf::Doc("acceleration of gravity along the y axis of the base")};
    rtcf::Parameter<double> gravity_z{
        this, "gravity_z", -9.80665, rtcf::Unit("m/s^2"),
        rtcf::Doc("acceleration of gravity along the z axis of the base")};
    rtcf::Parameter<double> share{this,           "share",        1.0,
                                  rtcf::Min(0.0), rtcf::Max(1.0), rtcf::Doc("compensated share")};
    rtcf::Parameter<double> fade{this,
                                 "fade",
                                 0.2,
                                 rtcf::Min(0.0),
                                 rtcf::Unit("s"),
                                 rtcf::Doc("time of the transition after a change of parameters "
                                           "or robot; 0 = at once")};
    rtcf::Derived<Setup> setup_{this};
    MeasurementWatch<1> watch_{this, {"measured"}, "command holds the robot at its last positions"};

    rtcf::State<Identity> identity_{this, "identity", {}, rtcf::Doc("robot and joints")};
    rtcf::State<bool> begun_{this, "begun", false, rtcf::Doc("the positions are known")};
    rtcf::State<JointNumbers> position_{this, "position", {}, rtcf::Doc("last positions")};
    rtcf::State<JointNumbers> last_{this, "last", {}, rtcf::Doc("last efforts")};
    rtcf::State<Law> law_{this, "law", {}, rtcf::Doc("parameters of the last cycle")};
    rtcf::State<JointNumbers> offset_{
        this, "offset", {}, rtcf::Doc("difference to the efforts before the change")};
    rtcf::State<double> rest_{this, "rest", 0.0,
                              rtcf::Doc("part of the transition that is left, 1 to 0")};
    rtcf::State<std::uint32_t> rejected_{this, "rejections", 0,
                                         rtcf::Doc("number of rejected messages")};

    std::unique_ptr<RobotChain> chain_;
    std::unique_ptr<const Identity> own_identity_;

    bool prepare(const rtcf::Values& proposed) override {
        Setup setup{proposed[urdf],
                    proposed[description],
                    {proposed[base], proposed[tip], words(proposed[joints])}};
        if (!setup.selection.joints.empty()) {
            if (const std::string why = jointsError(setup.selection.joints); !why.empty())
                return fail(why);
        }
        if (setup.urdf.empty() && setup.description.empty())
            return fail("urdf and description are empty: set one of them");
        setup_.stage(std::move(setup));
        return true;
    }

    bool configure() override {
        std::string text;
        if (!read(text)) return false;
        try {
            chain_ = std::make_unique<RobotChain>(text, setup_->selection);
        } catch (const std::exception& error) {
            if (isFile()) return RTCF_FAIL(this, "{}: {}", setup_->urdf, error.what());
            return fail("{}", error.what());
        }
        own_identity_ = std::make_unique<const Identity>(identityOf(text));
        for (const std::string& name : chain_->others())
            RTCF_WARN(this, "joint {} is not in the chain: its links count at position 0", name);
        sensor_msgs::JointState sample;
        sample.name = chain_->joints();
        sample.effort.resize(sample.name.size());
        command.reserve(sample);
        return true;
    }

    void cleanup() override { chain_.reset(); }

    bool start() override {
        begun_ = false;
        rejected_ = 0;
        watch_.begin();
        return true;
    }

    void update() override {
        adoptState();
        const bool is_new = measured.read() == rtcf::DataStatus::New;
        const bool is_good = is_new && follow(measured.value());
        if (begun_) watch(is_good);
        if (is_new && !is_good) ++rejected_;
        rejected.write(rejected_);
        if (begun_ && (is_good || !is_new)) write();
    }

    // Runs in the last cycle, too: without this effort, the robot falls.
    void safe() noexcept override { update(); }

    std::size_t count() const noexcept { return chain_->joints().size(); }

    bool isFile() const {
        return !setup_->urdf.empty() && setup_->urdf.find('<') == std::string::npos;
    }

    // Reads the text of the URDF.
    bool read(std::string& text) {
        const std::string& source = setup_->urdf;
        if (source.empty()) return readParameter(text);
        if (!isFile()) {
            text = source;
            return true;
        }
        errno = 0;
        std::ifstream file(source, std::ios::binary);
        text.resize(kLargestText + 1);
        if (file) file.read(text.data(), static_cast<std::streamsize>(text.size()));
        if (!file.is_open() || file.bad() || (file.gcount() == 0 && errno != 0))
            return RTCF_FAIL(this, "urdf: cannot read {}: {}", source, std::strerror(errno));
        text.resize(static_cast<std::size_t>(file.gcount()));
        if (text.size() > kLargestText)
            return RTCF_FAIL(this, "urdf: {} is larger than {} MiB", source, kLargestText >> 20U);
        return true;
    }

    bool readParameter(std::string& text) {
        const std::string& name = setup_->description;
        if (!rtcf::hasNode(this))
            return fail("urdf is empty, and without ROS there is no parameter {}: set urdf", name);
        const ros::NodeHandle node = rtcf::nodeHandle(this);
        std::string found;
        if (node.searchParam(name, found) && node.getParam(found, text)) return true;
        return RTCF_FAIL(this, "there is no ROS parameter {} with a text: set urdf or description",
                         name);
    }

    static std::uint64_t hash(const std::string& text, std::uint64_t seed) {
        // The final NUL separates texts.
        return rtcf::detail::stateHash(std::string_view(text.c_str(), text.size() + 1), seed);
    }
    Identity identityOf(const std::string& text) const {
        constexpr std::uint64_t kSeed = rtcf::detail::stateHash("");
        Identity identity;
        identity.robot =
            hash(setup_->selection.tip, hash(setup_->selection.base, hash(text, kSeed)));
        identity.joints = kSeed;
        for (const std::string& name : chain_->joints())
            identity.joints = hash(name, identity.joints);
        return identity;
    }

    // State of a predecessor with other joints is of no use. For another robot with the same
    // joints, efforts continue from the last ones.
    void adoptState() noexcept {
        if (identity_->joints != own_identity_->joints) begun_ = false;
        if (begun_ && identity_->robot != own_identity_->robot) {
            JointNumbers now;
            chain_->hold(position_, law_->gravity, now);
            for (std::size_t i = 0; i < count(); ++i)
                offset_.value()[i] = last_.value()[i] - law_->share * now[i];
            rest_ = 1.0;
        }
        identity_ = *own_identity_;
    }

    // Takes the positions from a message; returns false if it has to be rejected.
    bool follow(const sensor_msgs::JointState& message) noexcept {
        const Strings& names = chain_->joints();
        if (message.name.size() > kMostNames) return reject("it has more than 1024 names");
        JointPlaces places;
        if (const std::size_t twice = places.find(message.name, names); twice < count())
            return reject(twice, "twice in the message");
        if (message.position.size() != (message.name.empty() ? count() : message.name.size()))
            return reject("it does not have one position of each joint");
        for (std::size_t i = 0; i < count(); ++i) {
            if (places[i] == JointPlaces::kAbsent) return reject(i, "not in the message");
            if (!std::isfinite(message.position[places[i]]))
                return reject(i, "the position is not finite");
        }
        for (std::size_t i = 0; i < count(); ++i)
            position_.value()[i] = message.position[places[i]];
        if (!begun_) {
            rest_ = 0.0;
            law_ = now();
        }
        begun_ = true;
        return true;
    }

    bool reject(const char* why) noexcept {
        RTCF_WARN_THROTTLE(this, 1.0, "measured rejected: {}", why);
        return false;
    }
    bool reject(std::size_t joint, const char* why) noexcept {
        RTCF_WARN_THROTTLE(this, 1.0, "measured rejected: joint {}: {}", chain_->joints()[joint],
                           why);
        return false;
    }

    // Effort 0 is no safe output: the robot would fall.
    void watch(bool is_new) noexcept {
        double sum = 0.0;  // changes with any position
        for (std::size_t i = 0; i < count(); ++i) sum += position_.value()[i];
        // A message that was rejected does not count.
        const std::int64_t age =
            is_new || !watch_.valid(0) ? measured.age(this) : watch_.silence(0) + elapsed();
        if (const char* const fault = watch_.note(0, sum, age, elapsed())) reportFault(fault);
    }

    Law now() const noexcept { return {{gravity_x, gravity_y, gravity_z}, share}; }

    void write() noexcept {
        if (rest_ > 0.0) rest_ = fade > 0.0 ? std::max(0.0, rest_ - dt() / fade) : 0.0;
        const Law law = now();
        JointNumbers held;
        chain_->hold(position_, law.gravity, held);
        if (law != law_.value()) {
            JointNumbers before;
            chain_->hold(position_, law_->gravity, before);
            for (std::size_t i = 0; i < count(); ++i) {
                double& offset = offset_.value()[i];
                offset = law_->share * before[i] + rest_ * offset - law.share * held[i];
            }
            rest_ = fade > 0.0 ? 1.0 : 0.0;
            law_ = law;
        }
        sensor_msgs::JointState& message = command.value();
        message.header.stamp.fromNSec(
            static_cast<std::uint64_t>(std::max<std::int64_t>(stamp(), 0)));
        for (std::size_t i = 0; i < count(); ++i) {
            last_.value()[i] = law.share * held[i] + rest_ * offset_.value()[i];
            message.effort[i] = last_.value()[i];
        }
        command.publish();
    }
};

}  // namespace
}  // namespace rtcf_control

RTCF_COMPONENT_NAMED(rtcf_control::GravityCompensation, "GravityCompensation",
                     "Efforts (N m or N) that hold 1 to 16 joints of a URDF against gravity, by "
                     "recursive Newton-Euler (Featherstone, Rigid Body Dynamics Algorithms, 2008)",
                     GravityCompensation)
