"""rtcf_control/GravityCompensation against the gradient of the potential energy of its URDF.

The reference has its own reader of URDF. It differentiates by complex steps (Squire & Trapp, SIAM
Review 40, 1998), which are exact up to rounding. Tolerance: efforts of size 1 to 100 differ by less
than ROUNDING. The C++ tests in tests/unit/cpp/control cover names, errors and changes.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rosgraph
import rtcf
from block_bench import PATH
from daemon_process import Daemon, with_ros
from ros_processes import Master
from rtcf.testing import Bench
from rtcf_shared.value_text import parse

ROUNDING = 1e-10
STEP = 1e-30
TYPE = "rtcf_control/GravityCompensation"


def numbers(element: ET.Element | None, name: str, default: str = "0 0 0") -> Any:
    text = default if element is None else element.get(name, default)
    return np.array([float(word) for word in text.split()])


def rotation(axis: Any, angle: Any) -> Any:
    """Return Rodrigues' rotation matrix; the angle may be complex."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def placed(origin: ET.Element | None) -> Any:
    """Return the transformation of an <origin>."""
    roll, pitch, yaw = numbers(origin, "rpy")
    found = np.eye(4, dtype=complex)
    for axis, angle in (((1, 0, 0), roll), ((0, 1, 0), pitch), ((0, 0, 1), yaw)):
        found[:3, :3] = rotation(np.array(axis, float), angle) @ found[:3, :3]
    found[:3, 3] = numbers(origin, "xyz")
    return found


def potential(urdf: str, positions: dict[str, Any], gravity: Any) -> Any:
    """Return the potential energy of all links, by recursion from the root."""
    robot = ET.fromstring(urdf)
    links = {each.get("name"): each for each in robot.findall("link")}
    joints = robot.findall("joint")
    children = {
        str(found.get("link")) for each in joints if (found := each.find("child")) is not None
    }

    def of(name: str, frame: Any) -> Any:
        energy: Any = 0.0
        inertial = links[name].find("inertial")
        if inertial is not None:
            mass = inertial.find("mass")
            assert mass is not None
            center = frame @ np.append(numbers(inertial.find("origin"), "xyz"), 1.0)
            energy -= float(mass.get("value", "0")) * gravity @ center[:3]
        for joint in joints:
            parent, child = joint.find("parent"), joint.find("child")
            assert parent is not None and child is not None
            if parent.get("link") != name:
                continue
            moved = np.eye(4, dtype=complex)
            position = positions.get(str(joint.get("name")), 0.0)
            axis = numbers(joint.find("axis"), "xyz", "1 0 0")
            axis = axis / np.linalg.norm(axis)
            if joint.get("type") == "prismatic":
                moved[:3, 3] = axis * position
            elif joint.get("type") != "fixed":
                moved[:3, :3] = rotation(axis, position)
            energy += of(str(child.get("link")), frame @ placed(joint.find("origin")) @ moved)
        return energy

    (root,) = [str(name) for name in links if name not in children]
    return of(root, np.eye(4, dtype=complex))


def efforts(urdf: str, joints: list[str], position: Any, gravity: Any) -> list[float]:
    found = []
    for moved in range(len(joints)):
        at = {name: complex(position[i], STEP * (i == moved)) for i, name in enumerate(joints)}
        found.append(float(np.imag(potential(urdf, at, gravity)) / STEP))
    return found


def random_robot(seed: int, count: int) -> tuple[str, list[str]]:
    """Return a chain of random joints and masses, with links that are fixed to it."""
    draw = np.random.default_rng(seed)

    def row(scale: float = 1.0) -> str:
        return " ".join(f"{each:.6f}" for each in draw.uniform(-scale, scale, 3))

    def link(name: str) -> str:
        return (
            f'<link name="{name}"><inertial><origin xyz="{row(0.3)}" rpy="{row(3)}"/>'
            f'<mass value="{draw.uniform(0.1, 4.0):.6f}"/>'
            '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        )

    parts, names = ['<link name="l0"/>'], []
    for i in range(count):
        kind = ["revolute", "continuous", "prismatic"][draw.integers(3)] if i else "revolute"
        names.append(f"j{i}")
        parts += [
            link(f"l{i + 1}"), link(f"tool{i}"),
            f'<joint name="j{i}" type="{kind}"><origin xyz="{row()}" rpy="{row(3)}"/>'
            f'<parent link="l{i}"/><child link="l{i + 1}"/><axis xyz="{row()}"/>'
            '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>',
            f'<joint name="f{i}" type="fixed"><origin xyz="{row()}" rpy="{row(3)}"/>'
            f'<parent link="l{i + 1}"/><child link="tool{i}"/></joint>',
        ]  # fmt: skip
    return f'<?xml version="1.0"?><robot name="r">{"".join(parts)}</robot>', names


@pytest.mark.parametrize(("seed", "count"), [(1, 1), (2, 3), (3, 6), (4, 7), (5, 16)])
def test_efforts_are_the_gradient_of_the_potential_energy(
    tmp_path: Path, seed: int, count: int
) -> None:
    urdf, names = random_robot(seed, count)
    file = tmp_path / "robot.urdf"
    file.write_text(urdf)
    gravity = np.array([1.5, -2.5, -9.0])
    position = np.random.default_rng(seed).uniform(-3.0, 3.0, (20, count))
    with Bench(TYPE, path=PATH, urdf=str(file), gravity_x=1.5, gravity_y=-2.5, gravity_z=-9.0,
               joints=" ".join(reversed(names))) as bench:  # fmt: skip
        first = bench.run({"measured.position": position})
        again = bench.run({"measured.position": position})
    found = first["command.effort"]
    assert found.tobytes() == again["command.effort"].tobytes()
    at: Any
    for at, row in zip(position, found, strict=True):
        expected = efforts(urdf, names, at[::-1], gravity)
        assert row[::-1].tolist() == pytest.approx(expected, abs=ROUNDING)


def test_the_text_of_a_urdf_may_be_the_parameter() -> None:
    urdf, names = random_robot(7, 2)
    with Bench(TYPE, path=PATH, urdf=urdf) as bench:
        found = bench.run({"measured.position": np.array([[0.3, -0.4]])})["command.effort"][0]
    expected = efforts(urdf, names, [0.3, -0.4], np.array([0.0, 0.0, -9.80665]))
    assert found.tolist() == pytest.approx(expected, abs=ROUNDING)


def test_measured_names_may_have_any_order(tmp_path: Path) -> None:
    urdf, names = random_robot(8, 2)
    file = tmp_path / "robot.urdf"
    file.write_text(urdf)
    with Bench("rtcf_examples/Identity", path=PATH) as bench:
        client = bench.client
        client.load(rtcf.component("rtcf_control", "GravityCompensation", name="gravity",
                                   parameters=[f"urdf:={file}"]))  # fmt: skip
        client.write("/gravity.measured", {"name": ["x", "j1", "j0"], "position": [9, -0.4, 0.3]})
        client.step(1)
        states = {each.name: parse(each.value) for each in client.get_component("/gravity").states}
    expected = efforts(urdf, names, [0.3, -0.4], np.array([0.0, 0.0, -9.80665]))
    assert states["last"][:2] == pytest.approx(expected, abs=ROUNDING)


@pytest.fixture
def ros_client(tmp_path: Path, master: Master) -> Iterator[rtcf.Client]:
    daemon = Daemon(tmp_path, with_ros(master.uri, ".*"))
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        yield client
    daemon.end()


def test_the_urdf_may_be_a_ros_parameter(ros_client: rtcf.Client, master: Master) -> None:
    component = rtcf.component("rtcf_control", "GravityCompensation", name="gravity", ns="/arm")
    with pytest.raises(rtcf.RefusedError, match="there is no ROS parameter robot_description"):
        ros_client.load(component)
    urdf, _ = random_robot(9, 2)
    rosgraph.Master("/test", master_uri=master.uri).setParam("/robot_description", urdf)
    ros_client.load(component)
    assert ros_client.get_component("/arm/gravity").full_name == "/arm/gravity"
