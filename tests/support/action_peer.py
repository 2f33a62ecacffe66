"""A client of the action FollowJointTrajectory; the tests start it as a separate program.

Reads a goal per line as JSON:
{"joints": [...], "points": [[time, positions, velocities, accelerations], ...],
"path": {joint: tolerance}, "goal": {joint: tolerance}, "cancel": s, "replace": s}. Points need no
accelerations. With "replace", the next line is sent so many seconds later, without waiting. Prints
its result as JSON: {"state": ..., "code": ..., "text": ..., "feedback": number}.
"""

import json
import sys
import time
from typing import Any

import actionlib
import rospy
from rtcf_launch.control_messages import classes
from trajectory_msgs.msg import JointTrajectoryPoint

MESSAGES = classes()


def goal_of(told: dict[str, Any]) -> Any:
    """Return a goal message."""
    goal = MESSAGES["FollowJointTrajectoryGoal"]()
    goal.trajectory.joint_names = told["joints"]
    for at, positions, velocities, *accelerations in told["points"]:
        goal.trajectory.points.append(
            JointTrajectoryPoint(
                positions=positions,
                velocities=velocities,
                accelerations=accelerations[0] if accelerations else [],
                time_from_start=rospy.Duration.from_sec(at),
            )
        )
    for kind in ("path", "goal"):
        for joint, tolerance in told.get(kind, {}).items():
            each = MESSAGES["JointTolerance"](name=joint, position=tolerance)
            getattr(goal, f"{kind}_tolerance").append(each)
    return goal


def main() -> None:
    """Send each goal, and print its result."""
    rospy.init_node("action_peer")
    client = actionlib.SimpleActionClient(sys.argv[1], MESSAGES["FollowJointTrajectoryAction"])
    assert client.wait_for_server(rospy.Duration(60))
    print("ready", flush=True)
    for line in sys.stdin:
        told = json.loads(line)
        feedback: list[Any] = []
        client.send_goal(goal_of(told), feedback_cb=feedback.append)
        if "replace" in told:
            time.sleep(told["replace"])
            continue
        if "cancel" in told:
            time.sleep(told["cancel"])
            client.cancel_goal()
        assert client.wait_for_result(rospy.Duration(60))
        result = client.get_result()
        print(
            json.dumps(
                {
                    "state": client.get_state(),
                    "code": result.error_code,
                    "text": result.error_string,
                    "feedback": len(feedback),
                }
            ),
            flush=True,
        )


if __name__ == "__main__":
    main()
