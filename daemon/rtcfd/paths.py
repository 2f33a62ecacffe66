"""Where things are by default: sockets, folders, the executor, components."""

import os
import sysconfig
from collections.abc import Sequence
from pathlib import Path

SOCKET = Path("/run/rtcfd/control.sock")
RUNTIME_DIR = Path("/run/rtcfd")
STATE_DIR = Path("/var/lib/rtcfd")
EXECUTOR = Path("/usr/lib/rtcf/rtcf-executor")


def component_folders(extra: Sequence[Path], build_tree: Path | None) -> list[Path]:
    """Return the folders that hold packages, the first ones win.

    Those named come first, then the build tree, then workspaces as catkin
    overlays them, then the system.
    """
    folders = list(extra)
    if build_tree is not None:
        folders.append(build_tree / "lib" / "rtcf")
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(os.pathsep):
        if prefix.startswith("/"):
            folders.append(Path(prefix) / "lib" / "rtcf")
    triplet = sysconfig.get_config_var("MULTIARCH")
    if triplet:
        folders.append(Path("/usr/lib") / triplet / "rtcf")
    folders.append(Path("/usr/lib/rtcf"))
    return list(dict.fromkeys(Path(os.path.abspath(folder)) for folder in folders))


def executor(build_tree: Path | None) -> Path:
    """Return the executor that belongs to this rtcfd."""
    return EXECUTOR if build_tree is None else build_tree / "bin" / "rtcf-executor"
