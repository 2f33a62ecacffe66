"""The robot of a runner for a page: links, joints and meshes from a URDF, and the joints' signals.

Functions with a `client` block on calls to rtcfd, and all read files: do not call them in the event
loop.
"""

from __future__ import annotations

import json
import math
import os
import stat
import struct
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import rtcf
from rtcf_shared.errors import RtcfError

from rtcf_scope import catalog

MOST_BYTES = 16 * 1024 * 1024  # of a file
_MOST_LINKS = 500
_SHAPES = ("mesh", "box", "cylinder", "sphere")
_GREY = [0.7, 0.7, 0.7, 1.0]
_MOVES = ("revolute", "continuous", "prismatic")
# Ports of the rtcf_control controllers that follow a position.
_MEASURED, _TARGET = "measured", "setpoint"
_SHARE = Path("/usr/share")
_MOST_BODIES = 100
_NOTHING_MORE: dict[str, Any] = {"layout": None, "bodies": [], "workspace": None, "note": ""}


class RobotError(RtcfError):
    """A URDF or a mesh that cannot be shown."""


class Robots:
    """The robots of all runners.

    file  the URDF for every runner; None: the one that a component's parameter names
    """

    def __init__(self, file: Path | None = None) -> None:
        self._file = file
        self._meshes: dict[str, Path] = {}  # by the name that pages have for it

    def describe(self, client: rtcf.Client, runner: str) -> dict[str, Any]:
        """Return the robot of a runner, without links if it has none; raises RtcfError."""
        graph = catalog.graph(client, runner)
        file = self._file or urdf_of(graph["components"])
        if file is None:
            return {"name": "", "file": "", "links": [], "signals": {}, **_NOTHING_MORE}
        robot = read_urdf(file)
        for link in robot["links"]:
            for visual in link["visuals"]:
                if visual["shape"] == "mesh":
                    visual["mesh"] = self._name(visual.pop("path"))
        joints = [link["joint"] for link in robot["links"] if link["moves"]]
        return {**robot, "file": str(file), "signals": signals(joints, graph), **beside(file)}

    def _name(self, path: Path) -> str:
        """Return the name of a mesh for pages."""
        for name, known in self._meshes.items():
            if known == path:
                return name
        name = str(len(self._meshes))
        self._meshes[name] = path
        return name

    def mesh(self, name: str) -> bytes:
        """Return the binary STL of a mesh of an earlier description; raises RobotError."""
        path = self._meshes.get(name)
        if path is None:
            raise RobotError("no such mesh: load the robot again")
        data = _read(path)
        if len(data) < 84 or len(data) != 84 + 50 * struct.unpack_from("<I", data, 80)[0]:
            raise RobotError(f"{path}: no binary STL file")
        return data


def signals(joints: list[str], graph: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the signals of joints by name.

    `position` is an output named JOINT_position. `target` is the setpoint of a controller that
    measures it, or None. `all` has every output of the joint.
    """
    names = {each["name"] for each in graph["signals"]}
    readers = {
        (component, port): connection
        for connection in graph["connections"]
        for component, port, _ in connection["readers"]
    }
    found: dict[str, dict[str, Any]] = {}
    for joint in joints:
        own = sorted(each for each in names if each.rpartition(".")[2].startswith(f"{joint}_"))
        position = next((each for each in own if each.endswith(f".{joint}_position")), None)
        if position is not None:
            found[joint] = {
                "position": position, "target": _target(position, readers, names), "all": own
            }  # fmt: skip
    return found


def _target(position: str, readers: Mapping[tuple[str, str], Any], names: set[str]) -> str | None:
    component, _, port = position.rpartition(".")
    for (reader, input_), connection in readers.items():
        if input_ != _MEASURED or connection["writer"] != [component, port]:
            continue
        writer = readers.get((reader, _TARGET), {}).get("writer")
        if writer and ".".join(writer) in names:
            return ".".join(writer)
    return None


def urdf_of(components: list[dict[str, Any]]) -> Path | None:
    """Return the URDF that a parameter names, or the one beside a model of MuJoCo."""
    for component in components:
        for parameter in component["parameters"]:
            value = parameter["value"]
            if not isinstance(value, str) or not value.startswith("/"):
                continue
            path = Path(value)
            if path.suffix == ".urdf":
                return path
            beside = path.with_suffix(".urdf")
            if path.suffix == ".xml" and beside.is_file():
                return beside
    return None


def read_urdf(file: Path) -> dict[str, Any]:
    """Return name and links of a URDF. Meshes have their `path`; raises RobotError."""
    data = _read(file)
    # Expat expands the entities that a document type declares, without a limit.
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise RobotError(f"{file}: a URDF has no document type")
    try:
        robot = ET.fromstring(data)
    except (ET.ParseError, ValueError) as error:
        raise RobotError(f"{file}: {error}") from None
    if robot.tag != "robot":
        raise RobotError(f"{file}: its root is <{robot.tag}>, not <robot>")
    elements = robot.findall("link")
    if len(elements) > _MOST_LINKS:
        raise RobotError(f"{file}: more than {_MOST_LINKS} links")
    colours = {each.get("name", ""): _rgba(each, file) for each in robot.findall("material")}
    links = [_link(each, colours, file) for each in elements]
    _join(links, robot, file)
    return {"name": robot.get("name", ""), "links": links}


def _read(file: Path) -> bytes:
    """Return the content of a regular file: a device or a pipe could block, or never end."""
    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_NONBLOCK)
        try:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise RobotError(f"{file}: not a file")
            with open(descriptor, "rb", closefd=False) as opened:
                data = opened.read(MOST_BYTES + 1)
        finally:
            os.close(descriptor)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise RobotError(f"{file}: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > MOST_BYTES:
        raise RobotError(f"{file}: larger than {MOST_BYTES >> 20} MiB")
    return data


def beside(file: Path) -> dict[str, Any]:
    """Return the content of ROBOT.scope.json beside ROBOT.urdf: a layout, bodies around the robot,
    and the space to show. An error is a note: the robot itself can be shown.
    """
    path = file.with_suffix(".scope.json")
    if not path.exists():
        return _NOTHING_MORE
    try:
        found = json.loads(_read(path))
        if not isinstance(found, dict):
            raise RobotError(f"{path}: not an object")
        layout, bodies, space = (found.get(each) for each in ("layout", "bodies", "workspace"))
        if layout is not None and not isinstance(layout, dict):
            raise RobotError(f"{path}: layout is not an object")
        if bodies is not None and (not isinstance(bodies, list) or len(bodies) > _MOST_BODIES):
            raise RobotError(f"{path}: bodies is not a list of at most {_MOST_BODIES}")
        made = [_body(each, f"{path}: bodies[{i}]") for i, each in enumerate(bodies or [])]
        if space is not None:
            corners = space if isinstance(space, dict) else {}
            space = {
                each: _vector(corners.get(each), 3, f"{path}: workspace {each}")
                for each in ("low", "high")
            }
        return {"layout": layout, "bodies": made, "workspace": space, "note": ""}
    except (ValueError, RecursionError) as error:
        return {**_NOTHING_MORE, "note": f"{path}: {error}"}
    except RobotError as error:
        return {**_NOTHING_MORE, "note": str(error)}


def _body(found: Any, where: str) -> dict[str, Any]:
    """Return a body around the robot: fixed, or at the pose that a message gives."""
    found = found if isinstance(found, dict) else {}
    shape = found.get("shape")
    body: dict[str, Any] = {"name": str(found.get("name", "")), "shape": shape}
    if shape == "box":
        body["size"] = _vector(found.get("size"), 3, f"{where}: size")
    elif shape in ("sphere", "cylinder"):
        for each in ("radius", "length") if shape == "cylinder" else ("radius",):
            body[each] = _vector([found.get(each)], 1, f"{where}: {each}")[0]
    else:
        raise RobotError(f"{where}: shape is no box, sphere or cylinder")
    body["rgba"] = _vector(found.get("rgba", _GREY), 4, f"{where}: rgba")
    for each in ("xyz", "rpy"):
        body[each] = _vector(found.get(each, [0, 0, 0]), 3, f"{where}: {each}")
    pose = found.get("pose")
    if pose is not None and not isinstance(pose, str):
        raise RobotError(f"{where}: pose is not the name of an output")
    return {**body, "pose": pose or ""}


def _vector(found: Any, count: int, what: str) -> list[float]:
    """Return finite numbers; raises RobotError."""
    values = found if isinstance(found, list) else []
    numbers = [float(each) for each in values if isinstance(each, int | float)]
    if len(numbers) != count or len(values) != count or not all(map(math.isfinite, numbers)):
        raise RobotError(f"{what} needs {count} number{'s' if count > 1 else ''}")
    return numbers


def _link(element: ET.Element, colours: Mapping[str, list[float]], file: Path) -> dict[str, Any]:
    visuals = (_visual(each, colours, file) for each in element.findall("visual"))
    return {"name": element.get("name", ""), "parent": None, "joint": "", "moves": False,
            "visuals": [each for each in visuals if each is not None]}  # fmt: skip


def _visual(
    element: ET.Element, colours: Mapping[str, list[float]], file: Path
) -> dict[str, Any] | None:
    geometry = element.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    if shape is None or shape.tag not in _SHAPES:
        return None
    material = element.find("material")
    colour = _GREY
    if material is not None:
        is_own = material.find("color") is not None
        colour = _rgba(material, file) if is_own else colours.get(material.get("name", ""), _GREY)
    found: dict[str, Any] = {"shape": shape.tag, "rgba": colour, **_origin(element, file)}
    if shape.tag == "mesh":
        path = _mesh_path(shape.get("filename", ""), file)
        if path.suffix.lower() != ".stl":
            return None
        found["path"] = path
        found["scale"] = _numbers(shape.get("scale", "1 1 1"), 3, file)
    elif shape.tag == "box":
        found["size"] = _numbers(shape.get("size", ""), 3, file)
    else:
        found["radius"] = _numbers(shape.get("radius", ""), 1, file)[0]
        found["length"] = _numbers(shape.get("length", "0"), 1, file)[0]
    return found


def _join(links: list[dict[str, Any]], robot: ET.Element, file: Path) -> None:
    """Add each joint to its child link; raises RobotError unless they are a tree."""
    by_name = {link["name"]: link for link in links}
    for joint in robot.findall("joint"):
        name = joint.get("name", "")
        parent, child = (_reference(joint, tag) for tag in ("parent", "child"))
        if parent not in by_name or child not in by_name:
            raise RobotError(f"{file}: joint {name} refers to a link that is missing")
        link = by_name[child]
        if link["parent"] is not None:
            raise RobotError(f"{file}: link {child} has two parents")
        axis, limit, mimic = joint.find("axis"), joint.find("limit"), joint.find("mimic")
        link |= {
            "parent": parent, "joint": name, "type": joint.get("type", "fixed"),
            "moves": joint.get("type") in _MOVES, **_origin(joint, file),
            "axis": _numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"), 3, file),
            "lower": None if limit is None else _numbers(limit.get("lower", "0"), 1, file)[0],
            "upper": None if limit is None else _numbers(limit.get("upper", "0"), 1, file)[0],
            "mimic": None if mimic is None else {
                "joint": mimic.get("joint", ""),
                "multiplier": _numbers(mimic.get("multiplier", "1"), 1, file)[0],
                "offset": _numbers(mimic.get("offset", "0"), 1, file)[0],
            },
        }  # fmt: skip
    for link in links:
        if len(list(_ancestors(link, by_name))) > len(links):
            raise RobotError(f"{file}: link {link['name']} is its own ancestor")


def _ancestors(link: dict[str, Any], by_name: Mapping[str, dict[str, Any]]) -> Iterator[str]:
    """Yield them from the nearest on, at most one more than there are links."""
    for _ in range(len(by_name) + 1):
        if link["parent"] is None:
            return
        yield link["parent"]
        link = by_name[link["parent"]]


def _reference(joint: ET.Element, tag: str) -> str:
    found = joint.find(tag)
    return "" if found is None else found.get("link", "")


def _origin(element: ET.Element, file: Path) -> dict[str, Any]:
    origin = element.find("origin")
    texts = {} if origin is None else origin.attrib
    return {key: _numbers(texts.get(key, "0 0 0"), 3, file) for key in ("xyz", "rpy")}


def _rgba(material: ET.Element, file: Path) -> list[float]:
    colour = material.find("color")
    return _GREY if colour is None else _numbers(colour.get("rgba", ""), 4, file)


def _numbers(text: str, count: int, file: Path) -> list[float]:
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        found = []
    if len(found) != count or not all(abs(each) < 1e9 for each in found):
        raise RobotError(f'{file}: "{text}" should be {count} numbers')
    return found


def _mesh_path(name: str, file: Path) -> Path:
    """Return the file of a mesh: package://PACKAGE/PATH, file:///PATH, or relative to the URDF."""
    address = urlsplit(name)
    path = unquote(address.path)
    if address.scheme == "package":
        inside = path.lstrip("/")
        for folder in [*file.parents, *_packages(address.netloc)]:
            if folder.name == address.netloc and (folder / inside).is_file():
                return folder / inside
        return _SHARE / address.netloc / inside
    return Path(path) if address.scheme == "file" else file.parent / name


def _packages(name: str) -> Iterator[Path]:
    for folder in os.environ.get("ROS_PACKAGE_PATH", "").split(":"):
        if folder:
            yield Path(folder) / name
    yield _SHARE / name
