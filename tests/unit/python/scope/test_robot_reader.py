"""The robot for the scope's page: URDFs, meshes, and the signals of joints."""

import json
import os
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rtcf_scope import robot
from rtcf_scope.robot import RobotError, Robots

ARM = """\
<robot name="arm">
  <material name="red"><color rgba="1 0 0 1"/></material>
  <link name="base"><visual><geometry><box size="1 2 3"/></geometry></visual></link>
  <link name="tool">
    <visual>
      <origin xyz="0 0 0.5" rpy="0 1.5 0"/>
      <geometry><mesh filename="package://arm/meshes/tool.stl" scale="2 2 2"/></geometry>
      <material name="red"/>
    </visual>
    <visual><geometry><mesh filename="tool.dae"/></geometry></visual>
  </link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="tool"/>
    <origin xyz="0 0 1"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/>
  </joint>
</robot>
"""


def arm(folder: Path) -> Path:
    """Write the URDF into the folder arm, with its mesh of one triangle."""
    file = folder / "arm" / "urdf" / "arm.urdf"
    file.parent.mkdir(parents=True)
    file.write_text(ARM)
    mesh = folder / "arm" / "meshes" / "tool.stl"
    mesh.parent.mkdir()
    mesh.write_bytes(bytes(80) + struct.pack("<I", 1) + bytes(50))
    return file


def test_links_have_their_joints_and_shapes(tmp_path: Path) -> None:
    found = robot.read_urdf(arm(tmp_path))
    base, tool = found["links"]
    assert found["name"] == "arm"
    assert base["parent"] is None
    (box,) = base["visuals"]
    assert (box["shape"], box["size"], box["rgba"]) == ("box", [1, 2, 3], [0.7, 0.7, 0.7, 1.0])
    assert (tool["parent"], tool["joint"], tool["type"], tool["moves"]) == (
        "base", "turn", "revolute", True
    )  # fmt: skip
    assert (tool["xyz"], tool["axis"], tool["lower"], tool["upper"]) == (
        [0, 0, 1], [0, 1, 0], -1, 2
    )  # fmt: skip
    (mesh,) = tool["visuals"]  # pages read no other meshes than STL
    assert mesh["path"] == tmp_path / "arm" / "meshes" / "tool.stl"
    assert (mesh["scale"], mesh["rgba"], mesh["rpy"]) == ([2, 2, 2], [1, 0, 0, 1], [0, 1.5, 0])


def test_meshes_are_found_in_ros_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = arm(tmp_path)
    elsewhere = tmp_path / "other.urdf"
    elsewhere.write_text(file.read_text())
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{tmp_path}")
    mesh = robot.read_urdf(elsewhere)["links"][1]["visuals"][0]
    assert mesh["path"] == tmp_path / "arm" / "meshes" / "tool.stl"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("</robot>", "", "no element found"),
        ("<robot", "<!DOCTYPE robot [<!ENTITY a 'b'>]><robot", "a URDF has no document type"),
        ('<robot name="arm">', "<sdf>", "mismatched tag"),
        ('size="1 2 3"', 'size="1 2"', '"1 2" should be 3 numbers'),
        ('size="1 2 3"', 'size="1 2 nan"', '"1 2 nan" should be 3 numbers'),
        ('rgba="1 0 0 1"', 'rgba="red"', '"red" should be 4 numbers'),
        ('child link="tool"', 'child link="hand"', "joint turn refers to a link that is missing"),
        ('parent link="base"', 'parent link="tool"', "link tool is its own ancestor"),
        (
            "</robot>",
            '<joint name="two"><parent link="base"/><child link="tool"/></joint></robot>',
            "link tool has two parents",
        ),
    ],
)
def test_an_unreadable_urdf_is_one_line_with_its_file(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    file = tmp_path / "broken.urdf"
    assert old in ARM
    file.write_text(ARM.replace(old, new))
    with pytest.raises(RobotError) as error:
        robot.read_urdf(file)
    assert str(error.value).startswith(f"{file}: ")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@given(data=st.binary(max_size=300))
def test_any_bytes_are_a_urdf_or_an_error(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    file = tmp_path_factory.mktemp("any") / "any.urdf"
    file.write_bytes(data)
    with pytest.raises(RobotError):
        robot.read_urdf(file)


def test_devices_pipes_and_huge_files_are_no_urdf(tmp_path: Path) -> None:
    pipe, huge = tmp_path / "pipe.urdf", tmp_path / "huge.urdf"
    os.mkfifo(pipe)
    with huge.open("wb") as file:
        file.truncate(robot.MOST_BYTES + 1)
    for path, said in (
        (pipe, "not a file"),
        (Path("/dev/zero"), "not a file"),
        (tmp_path, "not a file"),
        (huge, "larger than 16 MiB"),
        (tmp_path / "missing.urdf", "No such file or directory"),
    ):
        with pytest.raises(RobotError, match=said):
            robot.read_urdf(path)


def test_only_meshes_of_a_description_are_served(tmp_path: Path) -> None:
    robots = Robots()
    with pytest.raises(RobotError, match="no such mesh"):
        robots.mesh("0")


def graph(**connections: tuple[str, list[str]]) -> dict[str, Any]:
    """Return a graph: the writer and the readers of each name, as "/component.port"."""
    ports = {port for writer, readers in connections.values() for port in (writer, *readers)}
    return {
        "signals": [{"name": port} for port in ports],
        "connections": [
            {
                "writer": writer.split("."),
                "readers": [[*each.split("."), False] for each in readers],
            }
            for writer, readers in connections.values()
        ],
    }


def test_the_target_of_a_joint_is_the_setpoint_of_its_controller() -> None:
    found = robot.signals(
        ["turn", "slide", "fixed"],
        graph(
            turn=("/robot.turn_position", ["/log.in", "/pid.measured"]),
            wanted=("/plan.position1", ["/pid.setpoint"]),
            slide=("/robot.slide_position", []),
            speed=("/robot.turn_velocity", []),
            other=("/robot.turning_position", []),
        ),
    )
    assert found == {
        "turn": {
            "position": "/robot.turn_position",
            "target": "/plan.position1",
            "all": ["/robot.turn_position", "/robot.turn_velocity"],
        },
        "slide": {
            "position": "/robot.slide_position",
            "target": None,
            "all": ["/robot.slide_position"],
        },
    }


def test_the_urdf_is_named_by_a_parameter_or_lies_beside_the_model(tmp_path: Path) -> None:
    def component(value: object) -> dict[str, Any]:
        return {"parameters": [{"value": value}]}

    assert robot.urdf_of([component("arm.urdf"), component(1.0)]) is None
    assert robot.urdf_of([component("/a/arm.urdf")]) == Path("/a/arm.urdf")
    model = tmp_path / "arm.xml"
    assert robot.urdf_of([component(str(model))]) is None
    (tmp_path / "arm.urdf").touch()
    assert robot.urdf_of([component(str(model))]) == tmp_path / "arm.urdf"


WHERE = "arm.scope.json"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", f"{WHERE}: Expecting property name"),
        ("[]", f"{WHERE}: not an object"),
        ('{"layout": 3}', f"{WHERE}: layout is not an object"),
        ('{"bodies": 3}', f"{WHERE}: bodies is not a list of at most 100"),
        ('{"bodies": [{}]}', f"{WHERE}: bodies[0]: shape is no box, sphere or cylinder"),
        ('{"bodies": [{"shape": "box"}]}', f"{WHERE}: bodies[0]: size needs 3 numbers"),
        (
            '{"bodies": [{"shape": "sphere", "radius": "1"}]}',
            f"{WHERE}: bodies[0]: radius needs 1 number",
        ),
        (
            '{"bodies": [{"shape": "box", "size": [1, 1, NaN]}]}',
            f"{WHERE}: bodies[0]: size needs 3 numbers",
        ),
        (
            '{"bodies": [{"shape": "box", "size": [1, 1, 1], "pose": 3}]}',
            f"{WHERE}: bodies[0]: pose is not the name of an output",
        ),
        ('{"workspace": {"low": [0, 0, 0]}}', f"{WHERE}: workspace high needs 3 numbers"),
        ("[" * 100_000, f"{WHERE}: maximum recursion depth"),
    ],
)
def test_an_error_beside_the_robot_is_a_note(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / WHERE).write_text(text)
    found = robot.beside(tmp_path / "arm.urdf")
    assert said in found["note"]
    assert found["bodies"] == [] and found["layout"] is None and found["workspace"] is None


def test_what_is_beside_the_robot_is_read(tmp_path: Path) -> None:
    assert robot.beside(tmp_path / "arm.urdf")["bodies"] == []
    body = {"name": "pole", "shape": "cylinder", "radius": 1, "length": 2, "pose": "/world.pole"}
    space = {"low": [0, 0, 0], "high": [1, 1, 1]}
    wanted = {"layout": {"span": 3}, "bodies": [body], "workspace": space}
    (tmp_path / WHERE).write_text(json.dumps(wanted))
    found = robot.beside(tmp_path / "arm.urdf")
    assert found["note"] == "" and found["layout"] == {"span": 3}
    assert found["workspace"] == {"low": [0.0] * 3, "high": [1.0] * 3}
    grey = {"rgba": [0.7, 0.7, 0.7, 1.0], "xyz": [0.0] * 3, "rpy": [0.0] * 3}
    assert found["bodies"] == [body | grey]
