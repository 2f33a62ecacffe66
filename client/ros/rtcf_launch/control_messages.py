"""The messages of control_msgs/FollowJointTrajectory, which Debian 12 does not have.

If the package control_msgs is on the search path, its own classes are used. Otherwise, classes are
made from the definitions below, with the same names and MD5 sums, so that any client fits.
"""

from typing import Any

_TOLERANCE = """\
string name
float64 position
float64 velocity
float64 acceleration
"""
_GOAL = """\
trajectory_msgs/JointTrajectory trajectory
JointTolerance[] path_tolerance
JointTolerance[] goal_tolerance
duration goal_time_tolerance
"""
_RESULT = """\
int32 error_code
int32 SUCCESSFUL = 0
int32 INVALID_GOAL = -1
int32 INVALID_JOINTS = -2
int32 OLD_HEADER_TIMESTAMP = -3
int32 PATH_TOLERANCE_VIOLATED = -4
int32 GOAL_TOLERANCE_VIOLATED = -5
string error_string
"""
_FEEDBACK = """\
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error
"""
_ACTION = """\
FollowJointTrajectoryActionGoal action_goal
FollowJointTrajectoryActionResult action_result
FollowJointTrajectoryActionFeedback action_feedback
"""
_HEADER = "std_msgs/Header header\n"
_STATUS = _HEADER + "actionlib_msgs/GoalStatus status\n"
_OWN = {
    "FollowJointTrajectoryActionGoal":
        _HEADER + "actionlib_msgs/GoalID goal_id\nFollowJointTrajectoryGoal goal\n",
    "FollowJointTrajectoryActionResult": _STATUS + "FollowJointTrajectoryResult result\n",
    "FollowJointTrajectoryActionFeedback": _STATUS + "FollowJointTrajectoryFeedback feedback\n",
    "FollowJointTrajectoryGoal": _GOAL,
    "FollowJointTrajectoryResult": _RESULT,
    "FollowJointTrajectoryFeedback": _FEEDBACK,
    "JointTolerance": _TOLERANCE,
}  # fmt: skip
_PACKAGE = "control_msgs"
_BETWEEN = "\n" + "=" * 80 + "\nMSG: "


def classes() -> dict[str, Any]:
    """Return the message classes by name, without the package."""
    try:
        import control_msgs.msg as found

        return {name: getattr(found, name) for name in ("FollowJointTrajectoryAction", *_OWN)}
    except ImportError:
        return _made()


def _made() -> dict[str, Any]:
    from actionlib_msgs.msg import GoalID, GoalStatus
    from genpy.dynamic import generate_dynamic
    from std_msgs.msg import Header
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

    parts = [f"{_PACKAGE}/{name}\n{text}" for name, text in _OWN.items()]
    # The definition of a message type ends with those of its fields, which are all in this list.
    for each in (Header, GoalID, GoalStatus, JointTrajectory, JointTrajectoryPoint):
        own, _, _ = each._full_text.partition("=" * 80)
        parts.append(f"{each._type}\n{own}")
    text = _BETWEEN.join([_ACTION, *parts])
    made = generate_dynamic(f"{_PACKAGE}/FollowJointTrajectoryAction", text)
    return {name.partition("/")[2]: each for name, each in made.items() if _PACKAGE in name}
