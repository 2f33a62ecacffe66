#include "gravity/robot_chain.hpp"

#include <console_bridge/console.h>
#include <fmt/format.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>
#include <kdl/frames.hpp>
#include <kdl/joint.hpp>
#include <kdl/rigidbodyinertia.hpp>
#include <kdl/segment.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace rtcf_control {
namespace {

using urdf::LinkConstSharedPtr;
using Path = std::vector<LinkConstSharedPtr>;

template <typename... Arguments>
[[noreturn]] void reject(const char* text, const Arguments&... arguments) {
    throw std::runtime_error(fmt::vformat(text, fmt::make_format_args(arguments...)));
}

// Keeps the errors that urdfdom logs, instead of printing them. Logging is global: one thread
// configures components.
class Errors final : public console_bridge::OutputHandler {
   public:
    Errors() { console_bridge::useOutputHandler(this); }
    ~Errors() override { console_bridge::restorePreviousOutputHandler(); }
    Errors(const Errors&) = delete;
    Errors& operator=(const Errors&) = delete;

    void log(const std::string& text, console_bridge::LogLevel level, const char* /*file*/,
             int /*line*/) override {
        if (level < console_bridge::CONSOLE_BRIDGE_LOG_ERROR || count_ == kMost) return;
        if (!text_.empty()) text_ += "; ";
        ++count_;
        text_ += text;
        std::replace(text_.begin(), text_.end(), '\n', ' ');
    }
    const std::string& text() const { return text_; }

   private:
    static constexpr int kMost = 3;  // the value, its element, and the link
    int count_ = 0;
    std::string text_;
};

// urdfdom leaves out an element that it cannot read, logs the error and still returns the model.
urdf::ModelInterfaceSharedPtr parse(const std::string& text) {
    Errors errors;
    urdf::ModelInterfaceSharedPtr model;
    std::string why;
    try {
        model = urdf::parseURDF(text);
    } catch (const std::exception& thrown) {
        why = thrown.what();
    }
    if (model != nullptr && model->getRoot() != nullptr && errors.text().empty()) return model;
    if (!errors.text().empty()) why = errors.text();
    reject("the URDF cannot be read: {}", why.empty() ? "it describes no robot" : why);
}

KDL::Frame frameOf(const urdf::Pose& pose) {
    return {KDL::Rotation::Quaternion(pose.rotation.x, pose.rotation.y, pose.rotation.z,
                                      pose.rotation.w),
            KDL::Vector(pose.position.x, pose.position.y, pose.position.z)};
}

bool isMoving(const urdf::Joint& joint) { return joint.type != urdf::Joint::FIXED; }

// The effect of gravity depends only on the mass and its centre.
KDL::RigidBodyInertia inertiaOf(const urdf::Link& link) {
    if (link.inertial == nullptr) return KDL::RigidBodyInertia::Zero();
    const double mass = link.inertial->mass;
    if (!std::isfinite(mass) || mass < 0.0)
        reject("link {}: its mass {} is not finite and 0 or above", link.name, mass);
    for (const double moment : {link.inertial->ixx, link.inertial->iyy, link.inertial->izz}) {
        if (!std::isfinite(moment) || moment < 0.0)
            reject("link {}: its moment of inertia {} is not finite and 0 or above", link.name,
                   moment);
    }
    return KDL::RigidBodyInertia(mass, frameOf(link.inertial->origin).p);
}

// Finds paths and masses in the tree of links.
class Robot {
   public:
    explicit Robot(const std::string& text) : model_(parse(text)) {}

    LinkConstSharedPtr link(const std::string& name, const char* what) const {
        LinkConstSharedPtr found = model_->getLink(name);
        if (found == nullptr) reject("{}: link {} is not in the URDF", what, name);
        return found;
    }

    // The links after the base, up to the tip.
    Path path(const RobotChain::Selection& wanted) const {
        const LinkConstSharedPtr base =
            wanted.base.empty() ? LinkConstSharedPtr(model_->getRoot()) : link(wanted.base, "base");
        LinkConstSharedPtr tip;
        if (!wanted.tip.empty()) {
            tip = link(wanted.tip, "tip");
        } else {
            tip = wanted.joints.empty() ? end(base) : last(wanted.joints);
        }
        Path found;
        for (LinkConstSharedPtr at = tip; at != base; at = at->getParent()) {
            found.push_back(at);
            if (at->getParent() == nullptr || found.size() > model_->links_.size())
                reject("there is no path from base {} to tip {}", base->name, tip->name);
        }
        std::reverse(found.begin(), found.end());
        return found;
    }

    // The inertia of a link and of all links that it carries, without those of the chain. Adds the
    // moving joints between them to `others`.
    KDL::RigidBodyInertia carriedInertia(const urdf::Link& link, const urdf::Link* next,
                                         std::vector<std::string>& others,
                                         std::size_t depth = 0) const {
        if (depth > model_->links_.size()) reject("link {} is its own descendant", link.name);
        KDL::RigidBodyInertia sum = inertiaOf(link);
        for (const urdf::LinkSharedPtr& child : link.child_links) {
            if (child.get() == next) continue;
            const urdf::Joint& joint = *child->parent_joint;
            if (joint.parent_link_name != link.name)
                reject("link {} is the child of two joints", child->name);
            if (isMoving(joint)) others.push_back(joint.name);
            sum = sum + frameOf(joint.parent_to_joint_origin_transform) *
                            carriedInertia(*child, nullptr, others, depth + 1);
        }
        return sum;
    }

    const urdf::ModelInterface& model() const { return *model_; }

   private:
    bool leadsToMotion(const urdf::Link& link, std::size_t depth = 0) const {
        if (depth > model_->links_.size()) reject("link {} is its own descendant", link.name);
        return std::any_of(link.child_links.begin(), link.child_links.end(), [&](const auto& each) {
            return isMoving(*each->parent_joint) || leadsToMotion(*each, depth + 1);
        });
    }

    // The link after the last moving joint.
    LinkConstSharedPtr end(LinkConstSharedPtr at) const {
        for (;;) {
            LinkConstSharedPtr next;
            for (const urdf::LinkSharedPtr& child : at->child_links) {
                if (!isMoving(*child->parent_joint) && !leadsToMotion(*child)) continue;
                if (next != nullptr)
                    reject("the robot branches at link {}, to {} and {}: set tip", at->name,
                           next->name, child->name);
                next = child;
            }
            if (next == nullptr) return at;
            at = next;
        }
    }

    // The link of the joint that is farthest from the root.
    LinkConstSharedPtr last(const std::vector<std::string>& joints) const {
        LinkConstSharedPtr farthest;
        std::size_t most = 0;
        for (const std::string& name : joints) {
            const urdf::JointConstSharedPtr joint = model_->getJoint(name);
            if (joint == nullptr) reject("joints: {} is not in the URDF", name);
            LinkConstSharedPtr child = model_->getLink(joint->child_link_name);
            std::size_t depth = 0;
            for (LinkConstSharedPtr at = child; at != nullptr; at = at->getParent()) {
                ++depth;
                if (depth > model_->links_.size())
                    reject("link {} is its own descendant", at->name);
            }
            if (depth <= most) continue;
            most = depth;
            farthest = child;
        }
        return farthest;
    }

    urdf::ModelInterfaceSharedPtr model_;
};

KDL::Joint jointOf(const urdf::Joint& joint) {
    if (!isMoving(joint)) return KDL::Joint(joint.name, KDL::Joint::Fixed);
    const bool turns = joint.type == urdf::Joint::REVOLUTE || joint.type == urdf::Joint::CONTINUOUS;
    if (!turns && joint.type != urdf::Joint::PRISMATIC)
        reject(
            "joint {} is neither revolute, continuous, prismatic nor fixed: choose base and tip "
            "without it",
            joint.name);
    if (joint.mimic != nullptr)
        reject("joint {} mimics {}: choose base and tip without it", joint.name,
               joint.mimic->joint_name);
    const KDL::Frame frame = frameOf(joint.parent_to_joint_origin_transform);
    const KDL::Vector axis(joint.axis.x, joint.axis.y, joint.axis.z);
    if (!(axis.Norm() > 0.0)) reject("joint {}: its axis is 0", joint.name);
    return {joint.name, frame.p, frame.M * axis,
            turns ? KDL::Joint::RotAxis : KDL::Joint::TransAxis};
}

}  // namespace

RobotChain::RobotChain(const std::string& urdf, const Selection& selection) {
    const Robot robot(urdf);
    const Path path = robot.path(selection);
    std::vector<std::string> in_chain;
    for (std::size_t i = 0; i < path.size(); ++i) {
        const urdf::Link& link = *path[i];
        const urdf::Joint& joint = *link.parent_joint;
        const urdf::Link* const next = i + 1 < path.size() ? path[i + 1].get() : nullptr;
        chain_.addSegment(KDL::Segment(link.name, jointOf(joint),
                                       frameOf(joint.parent_to_joint_origin_transform),
                                       robot.carriedInertia(link, next, others_)));
        if (isMoving(joint)) in_chain.push_back(joint.name);
    }
    if (in_chain.empty()) reject("no joint moves between base and tip");
    if (in_chain.size() > kMostJoints)
        reject("{} joints move between base and tip; at most {} may", in_chain.size(), kMostJoints);
    joints_ = selection.joints.empty() ? in_chain : selection.joints;
    for (std::size_t i = 0; i < joints_.size(); ++i) {
        const auto found = std::find(in_chain.begin(), in_chain.end(), joints_[i]);
        if (found == in_chain.end()) {
            const urdf::JointConstSharedPtr joint = robot.model().getJoint(joints_[i]);
            if (joint == nullptr) reject("joints: {} is not in the URDF", joints_[i]);
            if (!isMoving(*joint)) reject("joints: {} is fixed", joints_[i]);
            reject("joints: {} is not between base and tip", joints_[i]);
        }
        index_[i] = static_cast<std::size_t>(found - in_chain.begin());
    }
    for (const std::string& name : in_chain) {
        if (std::find(joints_.begin(), joints_.end(), name) == joints_.end())
            reject("joints lacks {}, which is between base and tip", name);
    }

    chain_position_.resize(chain_.getNrOfJoints());
    chain_effort_.resize(chain_.getNrOfJoints());
    for (std::size_t axis = 0; axis < unit_.size(); ++axis) {
        KDL::Vector gravity = KDL::Vector::Zero();
        gravity[static_cast<int>(axis)] = 1.0;
        unit_[axis] = std::make_unique<KDL::ChainDynParam>(chain_, gravity);
    }
    JointNumbers effort{};
    hold({}, {1.0, 1.0, 1.0}, effort);
    for (std::size_t i = 0; i < joints_.size(); ++i) {
        if (!std::isfinite(effort[i]))
            reject("joint {}: its effort is not finite: check masses and origins", joints_[i]);
    }
}

void RobotChain::hold(const JointNumbers& position, const std::array<double, 3>& gravity,
                      JointNumbers& effort) {
    const std::size_t count = joints_.size();
    for (std::size_t i = 0; i < count; ++i) {
        chain_position_(static_cast<unsigned>(index_[i])) = position[i];
        effort[i] = 0.0;
    }
    for (std::size_t axis = 0; axis < unit_.size(); ++axis) {
        if (gravity[axis] == 0.0) continue;
        unit_[axis]->JntToGravity(chain_position_, chain_effort_);
        for (std::size_t i = 0; i < count; ++i)
            effort[i] += gravity[axis] * chain_effort_(static_cast<unsigned>(index_[i]));
    }
}

}  // namespace rtcf_control
