"""`rosrun rtcf follow_joint_trajectory`: the action for a TrajectoryGenerator.

MoveIt and other clients send trajectories by this action. The node passes each to the input
`trajectory` of the generator, whose outputs and state show the progress. The loop itself runs
without the node. A new goal replaces the rest of the previous goal, which ends as preempted.
"""

from __future__ import annotations

import io
import os
import random
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rtcf
from rtcf.v1 import runner_pb2

from rtcf_launch import control_messages, runner_entry
from rtcf_launch.codes import Code
from rtcf_launch.master import Master

DESCRIPTION = """\
usage: rosrun rtcf follow_joint_trajectory [__name:=NAME] [_PARAMETER:=VALUE]...

Serves the action ~follow_joint_trajectory (control_msgs/FollowJointTrajectory) for a component
TrajectoryGenerator of rtcf_control, on the machine of its loop.

private parameters:
  generator         name of the component (default: trajectory)
  runner            name of the node rt_runner (default: rt_runner); if there is no such node, the
                    runner with this name of the system daemon, or of the daemon at RTCF_SOCKET
  joint_states      topic of the measured positions (default: joint_states)
  goal_time         time after the end of a trajectory, in s, within which the joints must reach
                    the tolerances of the goal, if the goal has no goal_time_tolerance (default: 1)
"""
_FEEDBACK_S = 0.05
_SIGNALS = (
    "done", "halted", "last_trajectory_number", "last_trajectory_seq", "rejections", "position",
    "commanded_velocity",
)  # fmt: skip
_ACCEPT_CYCLES = 2000  # longest wait until a trajectory is accepted or rejected
_QUEUE_CYCLES = 8  # the generator takes one message per cycle from a queue of this length
_END_S = 5.0  # longest wait for the stop of the joints at the end of the node


@dataclass(frozen=True)
class _Sample:
    """The values of the generator in one cycle."""

    done: bool
    halted: bool
    accepted: int  # number of accepted trajectories
    seq: int  # header.seq of the last accepted one
    rejected: int  # number of rejected ones, and of stops at a limit
    position: list[float]
    velocity: list[float]


class _FailedError(Exception):
    """The goal ends without success: the name of an error code, and a line of text."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


class _ReplacedError(_FailedError):
    """Another sender's trajectory has replaced that of the goal, and moves the joints now."""


class _PreemptedError(Exception):
    """The goal was cancelled, or another one has replaced it."""


class Server:
    """The action server of one generator."""

    def __init__(
        self, client: rtcf.Client, runner: str, generator: str, goal_time_s: float
    ) -> None:
        """Raises RefusedError if the runner has no such generator."""
        self._client = client
        self._runner = runner
        self._generator = client.get_component(generator, runner).full_name
        self._joints = self._parameter("joints").replace(",", " ").split()
        self._goal_time_s = goal_time_s
        self._messages = control_messages.classes()
        self._measured: dict[str, float] = {}
        self._moves = False  # a trajectory of this node may move the joints
        self._server: Any = None

    def serve(self, joint_states: str) -> None:
        """Serve the action until rospy ends; rospy's node has been initialised."""
        import actionlib
        import rospy
        from sensor_msgs.msg import JointState

        rospy.Subscriber(joint_states, JointState, self._measure)
        self._server = actionlib.SimpleActionServer(
            "~follow_joint_trajectory", self._messages["FollowJointTrajectoryAction"],
            execute_cb=self._execute, auto_start=False,
        )  # fmt: skip
        self._server.start()
        # A goal is aborted, and its client told, before the node leaves the master.
        rospy.on_shutdown(lambda: self._server.execute_thread.join(_END_S))
        rospy.loginfo(
            "follows trajectories of %s with %s", ", ".join(self._joints), self._generator
        )
        rospy.spin()

    def _parameter(self, name: str) -> str:
        info = self._client.get_component(self._generator, self._runner)
        found = next((each for each in info.parameters if each.name == name), None)
        if found is None:
            raise rtcf.RtcfError(
                f"{self._generator} is not a TrajectoryGenerator: it has no parameter {name}"
            )
        return str(found.value.string_value)

    def _measure(self, message: Any) -> None:
        self._measured = dict(zip(message.name, message.position, strict=False))

    def _execute(self, goal: Any) -> None:
        result = self._messages["FollowJointTrajectoryResult"]()
        try:
            self._follow(goal)
            self._moves = False
        except _PreemptedError:
            # The next goal replaces the trajectory.
            if not self._server.is_new_goal_available():
                self._stop()
            self._server.set_preempted(result, "another goal, or a cancel")
            return
        except _FailedError as error:
            self._moves = self._moves and not isinstance(error, _ReplacedError)
            text = str(error) + self._stop()
            result.error_code, result.error_string = getattr(result, error.code), text
        except (rtcf.RtcfError, ValueError) as error:
            text = str(error) + self._stop()
            result.error_code, result.error_string = result.INVALID_GOAL, text
        if result.error_code == result.SUCCESSFUL:
            self._server.set_succeeded(result)
        else:
            self._server.set_aborted(result, result.error_string)

    def _stop(self) -> str:
        """Stop the joints if a trajectory of this node may move them, also that of an earlier goal.

        Returns what to add to the text of an error if that fails.
        """
        if not self._moves:
            return ""
        try:
            # A trajectory without points stops the joints as fast as possible.
            stop = {"joint_names": self._joints, "points": []}
            self._client.write(f"{self._generator}.trajectory", stop, self._runner)
        except rtcf.RtcfError as error:
            return f"; the joints may move on: {error}"
        self._moves = False
        return ""

    def _follow(self, goal: Any) -> None:
        """Send a trajectory, and return when the joints have followed it.

        Raises _FailedError, _PreemptedError and RtcfError.
        """
        names = list(goal.trajectory.joint_names)
        if sorted(names) != sorted(self._joints):
            raise _FailedError(
                "INVALID_JOINTS",
                f"the joints of the goal, {', '.join(names)}, are not those of {self._generator}: "
                f"{', '.join(self._joints)}",
            )
        for each in (*goal.path_tolerance, *goal.goal_tolerance):
            if each.name not in self._joints:
                raise _FailedError("INVALID_GOAL", f"tolerance for an unknown joint {each.name}")
        (status,) = self._client.get_status(self._runner).runners
        if status.state != runner_pb2.RUNNER_STATE_RUNNING:
            raise _FailedError("INVALID_GOAL", f"the loop {self._runner} does not run")
        with self._client.watch_ports(
            [f"{self._generator}.{each}" for each in _SIGNALS], self._runner
        ) as stream:
            samples = self._samples(stream)
            before = next(samples)
            self._moves = True
            # Other senders use small numbers, by roscpp and rospy, or none.
            seq = random.randrange(2**31, 2**32)
            self._client.write(
                f"{self._generator}.trajectory", _as_dict(goal.trajectory, seq), self._runner
            )
            accepted = self._await_acceptance(samples, before, seq)
            self._await_end(samples, accepted, goal)
            self._await_goal(samples, goal)

    def _samples(self, stream: Any) -> Iterator[_Sample]:
        """Yield the values of each cycle; raises _FailedError at the end of the loop or node."""
        import rospy

        count = len(self._joints)
        for batch in stream:
            # is_shutdown() is false until the hooks of on_shutdown() have returned.
            if rospy.core.is_shutdown_requested() or rospy.is_shutdown():
                raise _FailedError("INVALID_GOAL", "the node follow_joint_trajectory ends")
            columns = {name: batch[f"{self._generator}.{name}"] for name in _SIGNALS}
            for row in range(len(batch)):
                yield _Sample(
                    bool(columns["done"][row]), bool(columns["halted"][row]),
                    int(columns["last_trajectory_number"][row]),
                    int(columns["last_trajectory_seq"][row]), int(columns["rejections"][row]),
                    [float(each) for each in columns["position"][row][:count]],
                    [float(each) for each in columns["commanded_velocity"][row][:count]],
                )  # fmt: skip
            if batch.last_of_loop:
                break
        raise _FailedError("INVALID_GOAL", "the loop has ended")

    def _await_acceptance(self, samples: Iterator[_Sample], before: _Sample, seq: int) -> _Sample:
        """Return the values of the cycle that accepts the trajectory with this header.seq."""
        cycles, rejected = _ACCEPT_CYCLES, False
        for sample in samples:
            if sample.seq == seq:
                return sample
            if not rejected and sample.rejected > before.rejected:
                # Perhaps another sender's, which was in the queue before this one.
                cycles, rejected = _QUEUE_CYCLES, True
            cycles -= 1
            if cycles <= 0:
                break
        if rejected:
            raise _FailedError(
                "INVALID_GOAL",
                f"{self._generator} rejects the trajectory: see its log, `rtcfctl logs`",
            )
        raise _FailedError("INVALID_GOAL", f"{self._generator} does not read the trajectory")

    def _await_end(self, samples: Iterator[_Sample], before: _Sample, goal: Any) -> None:
        """Return when the trajectory ends that was accepted in the cycle `before`."""
        import rospy

        sent = rospy.Time(0)
        for sample in samples:
            if self._server.is_preempt_requested():
                raise _PreemptedError
            if sample.accepted > before.accepted:
                raise _ReplacedError("INVALID_GOAL", "another trajectory has replaced it")
            if sample.halted:
                raise _FailedError("INVALID_GOAL", f"{self._generator} is halted")
            if sample.rejected > before.rejected:
                raise _FailedError(
                    "PATH_TOLERANCE_VIOLATED",
                    f"{self._generator} has stopped at a limit: see its log, `rtcfctl logs`",
                )
            self._check(sample, goal.path_tolerance, "PATH_TOLERANCE_VIOLATED")
            if rospy.Time.now() - sent > rospy.Duration(_FEEDBACK_S):
                sent = rospy.Time.now()
                self._send_feedback(sample)
            if sample.done:
                return

    def _await_goal(self, samples: Iterator[_Sample], goal: Any) -> None:
        """Wait until the joints are within the goal's tolerances, for at most its time."""
        import rospy

        given = goal.goal_time_tolerance.to_sec()
        end = rospy.Time.now() + rospy.Duration(given if given > 0.0 else self._goal_time_s)
        for sample in samples:
            try:
                self._check(sample, goal.goal_tolerance, "GOAL_TOLERANCE_VIOLATED")
                return
            except _FailedError:
                if given < 0.0 or rospy.Time.now() > end:
                    raise
            if self._server.is_preempt_requested():
                raise _PreemptedError

    def _check(self, sample: _Sample, tolerances: Sequence[Any], code: str) -> None:
        """Raise _FailedError if a joint is not within its tolerance; 0 or less = no tolerance."""
        for each in tolerances:
            if each.position <= 0.0:
                continue
            measured = self._measured.get(each.name)
            if measured is None:
                text = f"joint {each.name} has no measured position"
                raise _FailedError(code, text)
            away = abs(measured - sample.position[self._joints.index(each.name)])
            if away > each.position:
                text = f"joint {each.name} is {away:.4g} away, more than {each.position:.4g}"
                raise _FailedError(code, text)

    def _send_feedback(self, sample: _Sample) -> None:
        import rospy
        from trajectory_msgs.msg import JointTrajectoryPoint

        feedback = self._messages["FollowJointTrajectoryFeedback"]()
        feedback.header.stamp = rospy.Time.now()
        feedback.joint_names = self._joints
        nan = float("nan")
        actual = [self._measured.get(joint, nan) for joint in self._joints]
        feedback.desired = JointTrajectoryPoint(
            positions=sample.position, velocities=sample.velocity
        )
        feedback.actual = JointTrajectoryPoint(positions=actual)
        feedback.error = JointTrajectoryPoint(
            positions=[a - b for a, b in zip(sample.position, actual, strict=True)]
        )
        self._server.publish_feedback(feedback)


def _as_dict(trajectory: Any, seq: int) -> dict[str, Any]:
    def time(value: Any) -> dict[str, int]:
        return {"secs": value.secs, "nsecs": value.nsecs}

    return {
        "header": {"seq": seq, "stamp": time(trajectory.header.stamp)},
        "joint_names": list(trajectory.joint_names),
        "points": [
            {
                "positions": list(each.positions),
                "velocities": list(each.velocities),
                "accelerations": list(each.accelerations),
                "time_from_start": time(each.time_from_start),
            }
            for each in trajectory.points
        ],
    }


def main(build_tree: Path | None = None) -> int:
    """Run the node; return its exit status."""
    if any(word in ("-h", "--help") for word in sys.argv[1:]):
        print(DESCRIPTION, end="")
        return Code.DONE
    try:
        import rosgraph
        import rospy

        if isinstance(sys.stdout, io.TextIOWrapper):  # loginfo does not flush it
            sys.stdout.reconfigure(line_buffering=True)
        rospy.init_node("follow_joint_trajectory")
        name = rospy.resolve_name(rospy.get_param("~runner", "rt_runner"))
        entry = runner_entry.find(Master(rosgraph.get_master_uri(), rospy.get_name()), name)
        socket = entry.socket if entry is not None else os.environ.get("RTCF_SOCKET")
        runner = entry.runner if entry is not None else name.strip("/").replace("/", "_")
        with rtcf.Client(socket or None) as client:
            server = Server(
                client, runner, rospy.get_param("~generator", "trajectory"),
                float(rospy.get_param("~goal_time", 1.0)),
            )  # fmt: skip
            server.serve(rospy.get_param("~joint_states", "joint_states"))
    except ImportError as error:
        print(f"follow_joint_trajectory: {error}: sudo apt install python3-actionlib "
              "python3-trajectory-msgs python3-sensor-msgs", file=sys.stderr)  # fmt: skip
        return Code.REFUSED
    except (rtcf.RtcfError, ValueError) as error:
        print(f"follow_joint_trajectory: {error}", file=sys.stderr)
        return Code.REFUSED
    return Code.DONE
