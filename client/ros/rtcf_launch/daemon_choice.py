"""The choice of the rtcfd for the runner of a launch: the system's, or a private one.

`auto` selects the system's rtcfd if it answers and grants the necessary right, finds each package
in the same folder as this process, has the same ROS master, and the runner is free.
"""

import urllib.parse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import rtcf
from rtcf.v1 import runner_pb2
from rtcf_shared.folders import component_folders, packages

from rtcf_launch import runner_entry


@dataclass(frozen=True)
class Choice:
    """The chosen rtcfd: the system's or a private one, and the reason."""

    system: bool
    why: str


def choose(socket: str, runner: str, master_uri: str, build_tree: Path | None) -> Choice:
    """Return the choice for the parameter ~daemon = `auto`."""
    try:
        with rtcf.Client(socket) as client:
            objection = _objection(client, runner, master_uri, component_folders([], build_tree))
    except rtcf.DaemonUnreachableError as error:
        return Choice(False, error.what)
    except rtcf.RtcfError as error:
        return Choice(False, f"the system daemon reports an error: {error}")
    if objection:
        return Choice(False, objection)
    return Choice(True, "it is accessible, has all packages and the same ROS master")


def _objection(client: rtcf.Client, runner: str, master_uri: str, folders: Sequence[Path]) -> str:
    """Return a reason not to use the system daemon; empty = there is none."""
    runners = list(client.get_status().runners)
    here = [each for each in runners if each.runner == runner]
    for status in here:
        if status.hold:
            return f"the system daemon's runner {runner} is held by {status.holder}"
        if status.components:
            return f"the system daemon's runner {runner} has components of its own"
        if status.state == runner_pb2.RUNNER_STATE_RUNNING:
            return f"the loop of the system daemon's runner {runner} runs"
    for status in here or runners[:1]:
        uri = status.settings.ros.master_uri
        if not same_master(uri, master_uri):
            return f"the system daemon has another ROS master: {uri}, not {master_uri}"
    for package, libraries in sorted(packages(folders).items()):
        # The system's folders are searched by every rtcfd.
        if str(libraries[0]).startswith("/usr/lib/"):
            continue
        wanted = libraries[0].parent
        try:
            found = {Path(each.library).parent for each in client.list_types(package).types}
        except rtcf.RefusedError:
            found = set()
        if wanted not in found:
            return f"the system daemon does not load package {package} from {wanted}"
    return ""


def same_master(one: str, other: str) -> bool:
    """Return whether two URIs are those of the same master, judging by host name and port."""
    return _address(one) == _address(other)


def _address(uri: str) -> tuple[str, int | None]:
    try:
        parts = urllib.parse.urlsplit(uri)
        port = parts.port
    except ValueError:
        return uri, None
    name = (parts.hostname or "").lower()
    ours = ("localhost", "127.0.0.1", "::1", "127.0.1.1", runner_entry.host().lower())
    return "localhost" if name in ours else name, port
