"""The action FollowJointTrajectory: the arm follows an actionlib client's trajectories."""

import json
import subprocess
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import rtcf
from actionlib_msgs.msg import GoalStatus
from daemon_process import wait_for
from launch_processes import Launching, Process
from pages import SUPPORT
from ros_processes import Master
from rtcf_launch import control_messages
from values import port_value

JOINTS = [f"joint{i}" for i in range(1, 7)]
READY = [0.0, 0.3, 1.6, 0.0, 1.24, 0.0]
STANDS = [0.0] * 6
FAR = [[5.0, [2.0, *READY[1:]], STANDS]]
# As in the package control_msgs.
MD5 = {
    "FollowJointTrajectoryAction": "bc4f9b743838566551c0390c65f1a248",
    "FollowJointTrajectoryGoal": "69636787b6ecbde4d61d711979bc7ecb",
    "FollowJointTrajectoryResult": "493383b18409bfb604b4e26c676401d2",
    "FollowJointTrajectoryFeedback": "10817c60c2486ef6b33e97dcd87f4474",
    "FollowJointTrajectoryActionGoal": "cff5c1d533bf2f82dd0138d57f4304bb",
    "FollowJointTrajectoryActionResult": "c4fb3b000dc9da4fd99699380efcc5d9",
    "FollowJointTrajectoryActionFeedback": "d8920dc4eae9fc107e00999cce4be641",
}


class Peer:
    """The action's client."""

    def __init__(self, environment: dict[str, str], node: str = "/follow_joint_trajectory") -> None:
        self._process = subprocess.Popen(
            ["/usr/bin/python3", SUPPORT / "action_peer.py", f"{node}/follow_joint_trajectory"],
            env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "ready\n"

    def send(self, points: Any, joints: Any = JOINTS, **more: Any) -> Any:
        """Send a goal; return its result, or None if it is to be replaced."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        told = {"joints": joints, "points": points, **more}
        self._process.stdin.write(json.dumps(told) + "\n")
        self._process.stdin.flush()
        return None if "replace" in more else json.loads(self._process.stdout.readline())

    def end(self) -> None:
        self._process.kill()
        self._process.communicate()


@pytest.fixture(scope="module")
def launching(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launching]:
    """Yield the launched arm with the node."""
    folder = tmp_path_factory.mktemp("launch")
    master = Master(folder)
    master.start()
    launching = Launching(master, folder)
    try:
        launch = launching.roslaunch("rtcf_arm", "arm.launch", "daemon:=private")
        launch.wait_for_output("the loop runs with 32 components")
        node = launching.node("follow_joint_trajectory")
        node.wait_for_output("follows trajectories of joint1, ")
        yield launching
    finally:
        launching.end()
        master.end()


@pytest.fixture
def peer(launching: Launching) -> Iterator[Peer]:
    peer = Peer(launching.environment)
    yield peer
    peer.end()


@contextmanager
def another_node(launching: Launching, name: str, *words: str) -> Iterator[tuple[Process, Peer]]:
    """Yield another node for the same arm, and a client of it."""
    node = launching.node("follow_joint_trajectory", f"__name:={name}", *words)
    node.wait_for_output("follows trajectories of joint1, ")
    peer = Peer(launching.environment, f"/{name}")
    try:
        yield node, peer
    finally:
        peer.end()
        node.end()


def require_standing(launching: Launching, most: float = 1.5) -> None:
    """Check that the arm stands soon, before the end of a path of joint 1 to 2 rad."""
    wait_for(lambda: abs(measured(launching, "joint1_velocity")) < 1e-3, "the arm to stand")
    assert -0.1 < measured(launching, "joint1_position") < most


def measured(launching: Launching, port: str) -> float:
    """Return the newest value of a port of the robot."""
    with launching.client() as (client, runner):
        return port_value(client, "/robot", port, runner)


def test_the_messages_are_those_of_control_msgs() -> None:
    found = control_messages._made()
    assert {name: found[name]._md5sum for name in MD5} == MD5


def test_the_arm_follows_a_trajectory_with_joints_in_any_order(
    launching: Launching, peer: Peer
) -> None:
    goal = [0.4, 0.3, 1.6, 0.0, 1.0, 0.2]
    points = [[0.5, [0.2, *goal[1:]][::-1], STANDS], [1.2, goal[::-1], STANDS]]
    result = peer.send(points, JOINTS[::-1], goal=dict.fromkeys(JOINTS, 0.01))
    assert (result["state"], result["code"]) == (GoalStatus.SUCCEEDED, 0), result
    assert result["feedback"] >= 3
    for joint, wanted in zip(JOINTS, goal, strict=True):
        assert measured(launching, f"{joint}_position") == pytest.approx(wanted, abs=0.02)


def smooth(begin: Sequence[float], end: Sequence[float], duration: float, count: int) -> Any:
    """Return the points of a motion of degree 5 with velocities and accelerations."""
    points = []
    for s in (number / count for number in range(1, count + 1)):
        shares = (
            s**3 * (10 - 15 * s + 6 * s**2),
            30 * s**2 * (1 - s) ** 2 / duration,
            60 * s * (1 - s) * (1 - 2 * s) / duration**2,
        )
        ways = [[share * (b - a) for a, b in zip(begin, end, strict=True)] for share in shares]
        positions = [a + way for a, way in zip(begin, ways[0], strict=True)]
        points.append([s * duration, positions, *ways[1:]])
    return points


@pytest.mark.parametrize("count", [200, 1023])
def test_the_arm_follows_a_trajectory_of_many_points(
    launching: Launching, peer: Peer, count: int
) -> None:
    peer.send([[1.5, READY, STANDS]])
    goal = [each + 0.1 for each in READY]
    result = peer.send(smooth(READY, goal, 2.0, count), goal=dict.fromkeys(JOINTS, 0.01))
    assert (result["state"], result["code"]) == (GoalStatus.SUCCEEDED, 0), result
    for joint, wanted in zip(JOINTS, goal, strict=True):
        assert measured(launching, f"{joint}_position") == pytest.approx(wanted, abs=0.02)


def test_a_cancelled_goal_stops_the_arm(launching: Launching, peer: Peer) -> None:
    peer.send([[1.5, READY, STANDS]])
    result = peer.send(FAR, cancel=1.5)
    assert result["state"] == GoalStatus.PREEMPTED
    require_standing(launching)


def test_a_new_goal_replaces_the_present_one(launching: Launching, peer: Peer) -> None:
    peer.send([[1.5, READY, STANDS]])
    peer.send([[4.0, [1.5, *READY[1:]], STANDS]], replace=1.0)
    result = peer.send([[1.5, [-0.3, *READY[1:]], STANDS]], goal={"joint1": 0.01})
    assert (result["state"], result["code"]) == (GoalStatus.SUCCEEDED, 0), result
    assert measured(launching, "joint1_position") == pytest.approx(-0.3, abs=0.02)


def test_another_senders_trajectory_that_replaces_a_goal_goes_on(
    launching: Launching, peer: Peer
) -> None:
    peer.send([[1.5, READY, STANDS]])
    with launching.client() as (client, runner), ThreadPoolExecutor() as pool:
        sent = pool.submit(peer.send, FAR)
        wait_for(lambda: measured(launching, "joint1_velocity") > 0.1, "the arm to move")
        point = {"positions": [-0.2, *READY[1:]], "velocities": STANDS, "time_from_start": 2.0}
        other = {"joint_names": JOINTS, "points": [point]}
        client.write("/trajectory.trajectory", other, runner)
        result = sent.result(timeout=30.0)
    assert result["state"] == GoalStatus.ABORTED
    assert result["text"] == "another trajectory has replaced it"
    wait_for(lambda: measured(launching, "joint1_position") < -0.19, "the other goal")


@pytest.mark.parametrize(
    ("points", "more", "code", "said"),
    [
        ([[1.0, READY, STANDS]], {"joints": [*JOINTS[:5], "elbow"]}, -2,
         "are not those of /trajectory: joint1, joint2"),
        ([[1.0, [9.0, *READY[1:]], STANDS]], {}, -1, "/trajectory rejects the trajectory"),
        ([[1.0, READY, STANDS]], {"goal": {"elbow": 0.1}}, -1,
         "tolerance for an unknown joint elbow"),
        ([[2.0, [0.5, *READY[1:]], STANDS]], {"path": {"joint1": 1e-9}}, -4, "joint joint1 is "),
        ([[2.0, [0.1, *READY[1:]], STANDS]], {"goal": {"joint1": 1e-12}}, -5, "joint joint1 is "),
    ],
)  # fmt: skip
def test_a_goal_that_is_not_reached_says_why(
    peer: Peer, points: Any, more: Any, code: int, said: str
) -> None:
    result = peer.send(points, **more)
    assert result["state"] == GoalStatus.ABORTED
    assert result["code"] == code
    assert said in result["text"]
    assert "\n" not in result["text"]


def test_a_goal_that_is_aborted_stops_the_arm(launching: Launching, peer: Peer) -> None:
    peer.send([[1.5, READY, STANDS]])
    result = peer.send(FAR, path={"joint1": 1e-9})
    assert result["state"] == GoalStatus.ABORTED
    require_standing(launching)


def test_a_goal_without_measured_positions_is_aborted_and_the_arm_stands(
    launching: Launching, peer: Peer
) -> None:
    peer.send([[1.5, READY, STANDS]])
    with another_node(launching, "blind", "_joint_states:=nobody") as (_, blind):
        result = blind.send(FAR, path={"joint1": 0.5})
    assert (result["state"], result["code"]) == (GoalStatus.ABORTED, -4)
    assert result["text"] == "joint joint1 has no measured position"
    require_standing(launching)


def test_the_arm_stands_at_the_end_of_the_node(launching: Launching, peer: Peer) -> None:
    peer.send([[1.5, READY, STANDS]])
    with another_node(launching, "brief") as (node, other), ThreadPoolExecutor() as pool:
        sent = pool.submit(other.send, FAR)
        wait_for(lambda: measured(launching, "joint1_velocity") > 0.1, "the arm to move")
        node.end()
        result = sent.result(timeout=30.0)
    assert result["state"] == GoalStatus.ABORTED
    assert result["text"] == "the node follow_joint_trajectory ends"
    require_standing(launching)


def test_a_new_limit_in_front_of_the_arm_aborts_the_goal(launching: Launching, peer: Peer) -> None:
    peer.send([[1.5, READY, STANDS]])
    with launching.client() as (client, runner), ThreadPoolExecutor() as pool:
        sent = pool.submit(peer.send, FAR)
        wait_for(lambda: measured(launching, "joint1_velocity") > 0.1, "the arm to move")
        upper = rtcf.parse_parameter(f"upper:={' '.join(['1.8'] * 6)}")
        client.set_parameters("/trajectory", [upper], runner)
        try:
            result = sent.result(timeout=30.0)
        finally:
            client.undo_parameters("/trajectory", runner)
    assert (result["state"], result["code"]) == (GoalStatus.ABORTED, -4)
    assert "/trajectory has stopped at a limit" in result["text"]
    require_standing(launching, 1.81)


@pytest.mark.parametrize(
    ("position", "joints"), [(9.0, JOINTS), (0.5, [*JOINTS[:5], "elbow"])], ids=["far", "elbow"]
)
def test_an_invalid_goal_in_place_of_another_one_stops_the_arm(
    launching: Launching, peer: Peer, position: float, joints: Any
) -> None:
    peer.send([[1.5, READY, STANDS]])
    peer.send(FAR, replace=1.0)
    result = peer.send([[1.0, [position, *READY[1:]], STANDS]], joints)
    assert result["state"] == GoalStatus.ABORTED
    require_standing(launching)


def test_a_halt_aborts_the_goal_and_the_arm_stands(launching: Launching, peer: Peer) -> None:
    peer.send([[1.5, READY, STANDS]])
    with launching.client() as (client, runner), ThreadPoolExecutor() as pool:
        sent = pool.submit(peer.send, FAR)
        wait_for(lambda: measured(launching, "joint1_velocity") > 0.1, "the arm to move")
        client.write("/trajectory.halt", True, runner)
        try:
            result = sent.result(timeout=30.0)
        finally:
            client.write("/trajectory.halt", False, runner)
    assert result["state"] == GoalStatus.ABORTED
    assert "/trajectory is halted" in result["text"]
    require_standing(launching)


def test_a_component_that_is_no_generator_is_rejected(launching: Launching) -> None:
    node = launching.node("follow_joint_trajectory", "__name:=other", "_generator:=robot")
    assert node.wait(60.0) == 1
    assert "/robot is not a TrajectoryGenerator: it has no parameter joints" in node.output()
    missing = launching.node("follow_joint_trajectory", "__name:=third", "_generator:=nobody")
    assert missing.wait(60.0) == 1
    assert "nobody" in missing.output()


def test_help_names_the_parameters(launching: Launching) -> None:
    node = launching.node("follow_joint_trajectory", "--help")
    assert node.wait(60.0) == 0
    assert "goal_time" in node.output()
    assert Path(node.command.split()[0]).name == "follow_joint_trajectory"


def test_the_end_of_the_loop_aborts_the_goal(launching: Launching, peer: Peer) -> None:
    peer.send([[1.5, READY, STANDS]])
    with launching.client() as (client, runner), ThreadPoolExecutor() as pool:
        sent = pool.submit(peer.send, FAR)
        wait_for(lambda: measured(launching, "joint1_velocity") > 0.1, "the arm to move")
        client.stop(runner)
        result = sent.result(timeout=30.0)
        assert result["state"] == GoalStatus.ABORTED
        assert result["text"].startswith("the loop has ended")
        # The goal does not go on in the next loop.
        client.start(runner)
        before = measured(launching, "joint1_position")
        require_standing(launching)
        assert measured(launching, "joint1_position") == pytest.approx(before, abs=0.1)
