/// @file
/// The chain of joints from one link of a robot to another, and its gravity. Made from a URDF, by
/// KDL. Owned by its component.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <kdl/chain.hpp>
#include <kdl/chaindynparam.hpp>
#include <kdl/jntarray.hpp>

#include "joint_names.hpp"

namespace rtcf_control {

/// One number for each joint.
using JointNumbers = std::array<double, kMostJoints>;

class RobotChain {
   public:
    /// The part of a robot that is the chain.
    struct Selection {
        std::string base;  ///< link; empty = root of the robot
        /// Link; empty = the child link of the last of `joints`, or, without `joints`, the end of
        /// a robot that does not branch.
        std::string tip;
        /// All moving joints from base to tip, in the order of the numbers; empty = as in the
        /// chain.
        std::vector<std::string> joints;
    };

    /// Not real-time safe.
    /// @param urdf text of the URDF
    /// @throws std::runtime_error with one line
    RobotChain(const std::string& urdf, const Selection& selection);
    RobotChain(const RobotChain&) = delete;
    RobotChain& operator=(const RobotChain&) = delete;

    /// Names of the joints, 1 to kMostJoints. Real-time safe.
    const std::vector<std::string>& joints() const noexcept { return joints_; }
    /// Moving joints outside the chain whose links the chain carries. Their position counts as 0.
    const std::vector<std::string>& others() const noexcept { return others_; }

    /// Efforts that hold the robot at rest. Real-time safe.
    /// @param position rad or m
    /// @param gravity in the frame of the base, m/s^2
    /// @param effort result, N m or N; elements beyond the joints stay unchanged
    void hold(const JointNumbers& position, const std::array<double, 3>& gravity,
              JointNumbers& effort);

   private:
    std::vector<std::string> joints_;
    std::vector<std::string> others_;
    std::array<std::size_t, kMostJoints> index_{};  // of each joint in the chain
    KDL::Chain chain_;
    // Dynamics for a gravity of 1 m/s^2 along each axis. hold() combines them, because efforts are
    // linear in gravity, which may change.
    std::array<std::unique_ptr<KDL::ChainDynParam>, 3> unit_;
    KDL::JntArray chain_position_;
    KDL::JntArray chain_effort_;
};

}  // namespace rtcf_control
