#!/usr/bin/python3
"""Makes the arm's files: MJCF for the simulation, URDF and meshes for tools and drawings, and the
graph of its controllers.

    make_arm.py FOLDER [INSTALLED]

INSTALLED is the folder that the graph file names, if the files are used from there.

All come from the tables below, so masses, joints and limits are the same in all. The arm stands
upright with all joints at 0. Its joints are joint1 to joint6 and finger_joint.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from shapes import Mesh, box, cylinder, hull

Vector = tuple[float, float, float]

COLOURS = {"shell": (0.92, 0.92, 0.90), "joint": (0.16, 0.18, 0.21), "accent": (0.95, 0.45, 0.10)}


@dataclass
class Solid:
    """A cylinder or box for contacts; m. Axis: that of a cylinder."""

    size: Vector  # of a cylinder: radius, length, 0
    at: Vector
    axis: str = "z"
    is_box: bool = False


@dataclass
class Link:
    """A body with the joint before it; the joint's axis goes through its origin."""

    name: str
    parent: str
    offset: Vector  # of the joint in the parent, m
    joint: str
    axis: Vector
    lower: float  # rad; m of a finger
    upper: float
    velocity: float  # rad/s; m/s
    effort: float  # N m; N
    mass: float  # kg
    centre: Vector  # of mass, m
    inertia: Vector  # about the centre, main axes as the link's, kg m^2
    armature: float  # of the motor, behind its gear, kg m^2; kg
    damping: float  # N m s/rad; N s/m
    friction: float  # N m; N
    parts: dict[str, Mesh]  # by colour
    solids: list[Solid] = field(default_factory=list)
    mimics: str = ""
    is_slide: bool = False


def tube(mass: float, radius: float, length: float) -> Vector:
    """Return the moments of inertia of a solid cylinder along z."""
    across = mass * (3 * radius**2 + length**2) / 12
    return (across, across, mass * radius**2 / 2)


def housing(radius: float, width: float) -> Mesh:
    """Return a joint's cylinder along y."""
    return cylinder(radius, width, 0.006).along_y()


def beam(length: float, radius: float, end: float, width: float) -> Mesh:
    """Return a link from the origin to z = length, of a width along y."""
    return hull([(0.0, 0.0, radius), (length, 0.0, end)], width, 0.008).along_y()


def links() -> list[Link]:
    """Return the moving links, each after its parent."""
    return [
        Link(
            "shoulder", "base", (0, 0, 0.16), "joint1", (0, 0, 1), -2.9, 2.9, 2.5, 150,
            4.0, (0, 0, 0.08), tube(4.0, 0.08, 0.20), 0.5, 4.0, 2.5,
            {"shell": cylinder(0.075, 0.09, 0.008).moved(z=0.045),
             "joint": housing(0.07, 0.17).moved(z=0.14),
             "accent": cylinder(0.077, 0.012, 0.003).moved(z=0.01)},
            [Solid((0.075, 0.20, 0), (0, 0, 0.09))],
        ),
        Link(
            "upper_arm", "shoulder", (0, 0, 0.14), "joint2", (0, 1, 0), -1.9, 1.9, 2.5, 150,
            6.0, (0, 0, 0.17), tube(6.0, 0.06, 0.40), 0.5, 4.0, 2.5,
            {"shell": beam(0.36, 0.062, 0.049, 0.10),
             "joint": housing(0.052, 0.14).moved(z=0.36),
             "accent": housing(0.03, 0.172)},
            [Solid((0.06, 0.36, 0), (0, 0, 0.18))],
        ),
        Link(
            "forearm", "upper_arm", (0, 0, 0.36), "joint3", (0, 1, 0), -2.5, 2.5, 3.0, 80,
            3.0, (0, 0, 0.08), tube(3.0, 0.05, 0.20), 0.3, 2.0, 1.5,
            {"shell": beam(0.13, 0.05, 0.044, 0.085) + cylinder(0.042, 0.07, 0.006).moved(z=0.155),
             "accent": housing(0.024, 0.143)},
            [Solid((0.05, 0.18, 0), (0, 0, 0.08))],
        ),
        Link(
            "wrist_roll", "forearm", (0, 0, 0.19), "joint4", (0, 0, 1), -3.0, 3.0, 4.0, 28,
            1.6, (0, 0, 0.05), tube(1.6, 0.04, 0.13), 0.05, 0.5, 0.4,
            {"shell": cylinder(0.04, 0.07, 0.006).moved(z=0.04),
             "joint": housing(0.04, 0.10).moved(z=0.11),
             "accent": cylinder(0.042, 0.01, 0.003).moved(z=0.006)},
            [Solid((0.042, 0.13, 0), (0, 0, 0.06))],
        ),
        Link(
            "wrist_bend", "wrist_roll", (0, 0, 0.11), "joint5", (0, 1, 0), -2.0, 2.0, 4.0, 28,
            1.2, (0, 0, 0.03), tube(1.2, 0.035, 0.09), 0.05, 0.5, 0.4,
            {"shell": beam(0.05, 0.037, 0.034, 0.07) + cylinder(0.034, 0.03, 0.005).moved(z=0.065),
             "accent": housing(0.018, 0.103)},
            [Solid((0.036, 0.09, 0), (0, 0, 0.035))],
        ),
        Link(
            "hand", "wrist_bend", (0, 0, 0.08), "joint6", (0, 0, 1), -3.1, 3.1, 5.0, 15,
            0.9, (0, 0, 0.04), tube(0.9, 0.04, 0.08), 0.03, 0.3, 0.25,
            {"joint": cylinder(0.034, 0.03, 0.005).moved(z=0.015),
             "shell": box(0.055, 0.125, 0.045, 0.006).moved(z=0.05),
             "accent": box(0.057, 0.05, 0.012, 0.003).moved(z=0.05)},
            [Solid((0.055, 0.125, 0.07), (0, 0, 0.04), is_box=True)],
        ),
        *(
            Link(
                f"{side}_finger", "hand", (0, 0, 0.072), joint, (0, sign, 0), 0.0, 0.045, 0.2, 60,
                0.08, (0, sign * 0.008, 0.03), (3e-5, 3e-5, 1e-5), 0.1, 5.0, 1.0,
                {"joint": box(0.024, 0.014, 0.07, 0.003).moved(y=sign * 0.009, z=0.035),
                 "accent": box(0.022, 0.004, 0.03, 0.001).moved(y=sign * 0.002, z=0.05)},
                [Solid((0.022, 0.014, 0.07), (0, sign * 0.007, 0.035), is_box=True)],
                mimics, is_slide=True,
            )
            for side, joint, sign, mimics in (
                ("left", "finger_joint", 1.0, ""),
                ("right", "right_finger_joint", -1.0, "finger_joint"),
            )
        ),
    ]  # fmt: skip


BASE: dict[str, Mesh] = {
    "joint": cylinder(0.11, 0.03, 0.006).moved(z=0.015),
    "shell": cylinder(0.08, 0.13, 0.008).moved(z=0.095),
}
BASE_SOLID = Solid((0.09, 0.16, 0), (0, 0, 0.08))
READY = (0.0, 0.3, 1.6, 0.0, 1.24, 0.0)  # rad; the hand points down
FINGERS_OPEN = 0.04  # m
# Half sizes and places, m.
TABLE, TABLE_AT = (0.15, 0.3, 0.1), (0.45, 0.0, 0.1)
BLOCK, BLOCK_AT = 0.02, (0.45, 0.12, 0.22)


def numbers(values: Sequence[float]) -> str:
    """Return numbers as MJCF and URDF write them."""
    return " ".join(f"{value:.6g}" for value in values)


def urdf(all_links: Sequence[Link]) -> str:
    """Return the URDF; its meshes are in the folder meshes/ beside it."""
    lines = ['<?xml version="1.0"?>', "<!-- Made by make_arm.py. -->", '<robot name="rtcf_arm">']
    for colour, rgb in COLOURS.items():
        lines.append(f'  <material name="{colour}"><color rgba="{numbers((*rgb, 1))}"/></material>')
    lines += ['  <link name="base">', *_appearance("base", BASE, [BASE_SOLID]), "  </link>"]
    for link in all_links:
        moments = zip(("ixx", "iyy", "izz"), link.inertia, strict=True)
        inertia = " ".join(f'{name}="{moment:.6g}"' for name, moment in moments)
        lines += [
            f'  <link name="{link.name}">',
            "    <inertial>",
            f'      <origin xyz="{numbers(link.centre)}"/>',
            f'      <mass value="{link.mass:.6g}"/>',
            f'      <inertia {inertia} ixy="0" ixz="0" iyz="0"/>',
            "    </inertial>",
            *_appearance(link.name, link.parts, link.solids),
            "  </link>",
            f'  <joint name="{link.joint}" type="{"prismatic" if link.is_slide else "revolute"}">',
            f'    <parent link="{link.parent}"/>',
            f'    <child link="{link.name}"/>',
            f'    <origin xyz="{numbers(link.offset)}"/>',
            f'    <axis xyz="{numbers(link.axis)}"/>',
            f'    <limit lower="{link.lower:.6g}" upper="{link.upper:.6g}" '
            f'effort="{link.effort:.6g}" velocity="{link.velocity:.6g}"/>',
            f'    <dynamics damping="{link.damping:.6g}" friction="{link.friction:.6g}"/>',
            *([f'    <mimic joint="{link.mimics}"/>'] if link.mimics else []),
            "  </joint>",
        ]
    return "\n".join([*lines, "</robot>", ""])


def _appearance(name: str, parts: dict[str, Mesh], solids: Sequence[Solid]) -> list[str]:
    lines = []
    for colour in parts:
        mesh = f"package://rtcf_arm/meshes/{name}_{colour}.stl"
        lines.append(
            f'    <visual><geometry><mesh filename="{mesh}"/></geometry>'
            f'<material name="{colour}"/></visual>'
        )
    for solid in solids:
        shape = (
            f'<box size="{numbers(solid.size)}"/>'
            if solid.is_box
            else f'<cylinder radius="{solid.size[0]:.6g}" length="{solid.size[1]:.6g}"/>'
        )
        lines.append(
            f'    <collision><origin xyz="{numbers(solid.at)}"/>'
            f"<geometry>{shape}</geometry></collision>"
        )
    return lines


def mjcf(all_links: Sequence[Link], *, flexible: bool) -> str:
    """Return the MJCF: the arm on the floor, a table with a block.

    flexible  joints 1 to 3 have a spring between motor and link
    """
    lines = [
        "<!-- Made by make_arm.py. -->",
        '<mujoco model="rtcf_arm">',
        '  <compiler angle="radian" autolimits="true" inertiafromgeom="auto"/>',
        '  <option timestep="0.001" integrator="implicit" cone="elliptic"/>',
        "  <worldbody>",
        '    <geom name="floor" type="plane" size="2 2 0.1"/>',
        f'    <geom name="table" type="box" pos="{numbers(TABLE_AT)}" size="{numbers(TABLE)}"/>',
        f'    <body name="block" pos="{numbers(BLOCK_AT)}">',
        '      <freejoint name="block"/>',
        f'      <geom type="box" size="{numbers([BLOCK] * 3)}" mass="0.1" '
        'friction="1.5 0.02 0.001"/>',
        "    </body>",
        '    <body name="base">',
        *_solids([BASE_SOLID], 3),
        *_bodies(all_links, "base", 3, flexible),
        "    </body>",
        "  </worldbody>",
        "  <equality>",
        *(
            f'    <joint joint1="{link.joint}" joint2="{link.mimics}" polycoef="0 1 0 0 0"/>'
            for link in all_links
            if link.mimics
        ),
        "  </equality>",
        "  <contact>",
        *(f'    <exclude body1="{link.parent}" body2="{link.name}"/>' for link in all_links),
        "  </contact>",
        "  <actuator>",
        *(
            f'    <motor name="{link.joint}_torque" joint="{_motor(link, flexible)}" '
            f'ctrlrange="-{link.effort:.6g} {link.effort:.6g}"/>'
            for link in all_links
            if not link.mimics
        ),
        "  </actuator>",
        "  <keyframe>",
        f'    <key name="ready" qpos="{numbers(_ready(all_links, flexible))}"/>',
        "  </keyframe>",
        "</mujoco>",
        "",
    ]
    return "\n".join(lines)


def page(all_links: Sequence[Link]) -> str:
    """Return the first view of the scope's page: traces, and the bodies around the arm."""
    joints = [link.joint for link in all_links if not link.is_slide]
    panes = [
        [f"/robot.{each}_position" for each in joints],
        [f"/{each}/position.error" for each in joints],
        [f"/robot.{each}_effort" for each in joints],
    ]
    x, y, _ = TABLE_AT
    found = {
        "layout": {"span": 10, "panes": [{"traces": each} for each in panes]},
        "bodies": [
            {"name": "table", "shape": "box", "size": [2 * each for each in TABLE],
             "xyz": list(TABLE_AT), "rgba": [0.62, 0.55, 0.47, 1]},
            {"name": "block", "shape": "box", "size": [2 * BLOCK] * 3, "pose": "/robot.block_pose",
             "rgba": [0.8, 0.3, 0.1, 1]},
        ],
        "workspace": {"low": [-0.2, y - TABLE[1], 0], "high": [x + TABLE[0], y + TABLE[1], 1.0]},
    }  # fmt: skip
    return json.dumps(found, indent=1) + "\n"


def _is_flexible(link: Link, flexible: bool) -> bool:
    return flexible and link.joint in ("joint1", "joint2", "joint3")


def _motor(link: Link, flexible: bool) -> str:
    return f"{link.joint}_motor" if _is_flexible(link, flexible) else link.joint


def _ready(all_links: Sequence[Link], flexible: bool) -> list[float]:
    values = [*BLOCK_AT, 1.0, 0.0, 0.0, 0.0]
    for link in all_links:
        position = FINGERS_OPEN if link.is_slide else READY[int(link.joint[-1]) - 1]
        values += [position, 0.0] if _is_flexible(link, flexible) else [position]
    return values


def _bodies(all_links: Sequence[Link], parent: str, depth: int, flexible: bool) -> list[str]:
    indent = "  " * depth
    lines = []
    for link in all_links:
        if link.parent != parent:
            continue
        joint = (
            f'type="{"slide" if link.is_slide else "hinge"}" axis="{numbers(link.axis)}" '
            f'damping="{link.damping:.6g}" armature="{link.armature:.6g}" '
            f'frictionloss="{link.friction:.6g}"'
        )
        limits = f'range="{link.lower:.6g} {link.upper:.6g}"'
        lines.append(f'{indent}<body name="{link.name}" pos="{numbers(link.offset)}">')
        if _is_flexible(link, flexible):
            # The motor turns first; the spring is the joint of the link behind it.
            lines += [
                f'{indent}  <joint name="{link.joint}_motor" {joint} {limits}/>',
                f'{indent}  <joint name="{link.joint}_spring" type="hinge" '
                f'axis="{numbers(link.axis)}" stiffness="8000" damping="4" armature="0.01"/>',
            ]
        else:
            lines.append(f'{indent}  <joint name="{link.joint}" {joint} {limits}/>')
        lines += [
            f'{indent}  <inertial pos="{numbers(link.centre)}" mass="{link.mass:.6g}" '
            f'diaginertia="{numbers(link.inertia)}"/>',
            *_solids(link.solids, depth + 1, "1.5 0.02 0.001" if link.is_slide else ""),
            *_bodies(all_links, link.name, depth + 1, flexible),
            f"{indent}</body>",
        ]
    return lines


def _solids(solids: Sequence[Solid], depth: int, friction: str = "") -> list[str]:
    lines = []
    grip = f' friction="{friction}"' if friction else ""
    for solid in solids:
        half = [size / 2 for size in solid.size]
        shape = (
            f'type="box" size="{numbers(half)}"'
            if solid.is_box
            else f'type="cylinder" size="{numbers((solid.size[0], half[1]))}"'
        )
        lines.append(f'{"  " * depth}<geom {shape} pos="{numbers(solid.at)}"{grip}/>')
    return lines


@dataclass
class Gains:
    """The controllers of a joint: velocity from position, torque from velocity."""

    position: float  # 1/s
    velocity: float  # N m s/rad
    integral: float  # N m/rad


GAINS = [
    Gains(12, 120, 600), Gains(12, 120, 600), Gains(12, 40, 200),
    Gains(15, 4, 30), Gains(15, 4, 30), Gains(15, 2, 15),
]  # fmt: skip
JOINTS = [f"joint{i}" for i in range(1, 7)]
NAMES = " ".join(JOINTS)
ACCELERATIONS = [6.0, 6.0, 8.0, 12.0, 12.0, 15.0]  # of trajectories, rad/s^2


def graph(all_links: Sequence[Link], folder: Path) -> str:
    """Return the graph file: the robot in `folder`, and its controllers."""
    arm = [link for link in all_links if not link.is_slide]
    (finger,) = (link for link in all_links if link.is_slide and not link.mimics)
    components = [
        _component(
            "/robot", "rtcf_mujoco/Simulation",
            {"model": f"{folder}/arm.xml", "keyframe": "ready", "brake_friction": 300.0,
             "pushed_body": "hand"},
            # A reset of the emergency stop must not put the arm elsewhere.
            {"brake": "/stopped", "joint_states": "/joint_states", "reset": "~reset"},
            first=True,
        ),
        _component(
            "/operator", "rtcf_arm/Operator", {},
            {name: f"/{name}" for name in
             ("command", "done", "stopped", "target", "goal", "joy", "reset")}
            | {"stop": "/emergency_stop"},
            breaks=["command", "done", "stopped"],
        ),
        _component(
            "/trajectory", "rtcf_control/TrajectoryGenerator",
            {"joints": NAMES, "acceleration": " ".join(f"{each:g}" for each in ACCELERATIONS),
             "jerk": "60 60 80 120 120 150"}
            | {name: " ".join(f"{getattr(link, name):g}" for link in arm)
               for name in ("velocity", "lower", "upper")},
            {"measured": "/joint_states", "target": "/target", "command": "/command",
             "done": "/done", "idle": "/stopped"},
            breaks=["idle"],
        ),
        _component(
            "/setpoints", "rtcf_control/JointCommandSubscriber", {"joints": NAMES},
            {"command": "/command"}
            | {f"{quantity}{i}": f"/{joint}/{quantity}_wanted"
               for quantity in ("position", "velocity") for i, joint in enumerate(JOINTS, 1)},
        ),
        _component(
            "/gravity", "rtcf_control/GravityCompensation",
            {"urdf": f"{folder}/arm.urdf", "tip": "hand", "joints": NAMES, "gravity_z": -9.81},
            {"measured": "/joint_states", "command": "/gravity"},
            every=4,
        ),
        _component(
            "/gravity_efforts", "rtcf_control/JointCommandSubscriber", {"joints": NAMES},
            {"command": "/gravity"}
            | {f"effort{i}": f"/{joint}/gravity" for i, joint in enumerate(JOINTS, 1)},
            every=4,
        ),
    ]  # fmt: skip
    for link, gains in zip(arm, GAINS, strict=True):
        components += _controllers(link, gains)
    components += [
        _component(
            "/gripper/position", "rtcf_control/Pid",
            {"kp": 800.0, "kd": 25.0, "filter_time": 0.005, **_within(finger.effort)},
            {"setpoint": "/grip", "measured": f"/{finger.joint}_position", "effort": "force"},
        ),
        _stop("/gripper", "force", finger.joint),
    ]  # fmt: skip
    ros = {"whitelist": "/joint_states|/command|/target|/goal|/joy|/stopped"}
    found = {
        "runner": "rt_runner",
        "settings": {"frequency_hz": 1000, "ros": ros},
        "components": components,
    }
    text = yaml.safe_dump(found, sort_keys=False, default_flow_style=None, width=100)
    return f"# A simulated arm with a gripper, and its controllers. Made by make_arm.py.\n{text}"


def _component(
    name: str,
    of_type: str,
    parameters: dict[str, Any],
    remaps: dict[str, str],
    **flags: Any,
) -> dict[str, Any]:
    ns, _, base = name.rpartition("/")
    package, type_ = of_type.split("/")
    found: dict[str, Any] = {"name": base}
    if ns:
        found["ns"] = ns
    return found | {
        "package": package, "type": type_, "parameters": parameters, "remaps": remaps, **flags
    }  # fmt: skip


def _controllers(link: Link, gains: Gains) -> list[dict[str, Any]]:
    """Return the cascade of a joint: velocity from position, torque from velocity, limits, stop."""
    joint = link.joint
    position, velocity = f"/{joint}_position", f"/{joint}_velocity"
    return [
        _component(
            f"/{joint}/position", "rtcf_control/Pid",
            {"kp": gains.position, **_within(link.velocity)},
            {"setpoint": "position_wanted", "measured": position,
             "feedforward": "velocity_wanted", "effort": "speed"},
        ),
        _component(
            f"/{joint}/velocity", "rtcf_control/Pid",
            {"kp": gains.velocity, "ki": gains.integral, **_within(link.effort)},
            {"setpoint": "speed", "measured": velocity, "feedforward": "gravity",
             "manual": "/stopped", "effort": "torque"},
            breaks=["manual"],
        ),
        _component(
            f"/{joint}/limiter", "rtcf_control/JointLimiter",
            {"command": "effort", "lower": link.lower, "upper": link.upper,
             "max_velocity": round(1.2 * link.velocity, 3), "max_effort": float(link.effort),
             # Above the trajectory's, which therefore meets no limit.
             "deceleration": 1.5 * ACCELERATIONS[JOINTS.index(joint)],
             "k_velocity": gains.velocity},
            {"in": "torque", "position": position, "velocity": velocity, "out": "limited_torque"},
        ),
        # The arm's brakes and its trajectory follow the stop of the first joint.
        _stop(f"/{joint}", "limited_torque", joint, is_first=joint == JOINTS[0]),
    ]  # fmt: skip


def _stop(ns: str, torque: str, joint: str, *, is_first: bool = False) -> dict[str, Any]:
    remaps = {
        "in": torque,
        "stop1": "/emergency_stop",
        "reset": "/reset",
        "out": f"/{joint}_torque",
    }
    if is_first:
        remaps["stopped"] = "/stopped"
    return _component(f"{ns}/stop", "rtcf_control/EStop", {"start_stopped": False}, remaps)


def _within(limit: float) -> dict[str, float]:
    return {"lower": -float(limit), "upper": float(limit)}


def main() -> int:
    """Write all files into the folder given."""
    if len(sys.argv) not in (2, 3):
        print("usage: make_arm.py FOLDER [INSTALLED]", file=sys.stderr)
        return 2
    folder = Path(sys.argv[1])
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    all_links = links()
    (folder / "arm.xml").write_text(mjcf(all_links, flexible=False))
    (folder / "arm_flexible.xml").write_text(mjcf(all_links, flexible=True))
    (folder / "arm.urdf").write_text(urdf(all_links))
    (folder / "arm.scope.json").write_text(page(all_links))
    (folder / "arm.yaml").write_text(graph(all_links, Path(sys.argv[-1]).absolute()))
    for name, parts in [("base", BASE), *((link.name, link.parts) for link in all_links)]:
        for colour, mesh in parts.items():
            mesh.write_stl(folder / "meshes" / f"{name}_{colour}.stl")
    return 0


if __name__ == "__main__":
    sys.exit(main())
