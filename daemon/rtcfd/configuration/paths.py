"""Default paths of sockets, folders and the executor.

rtcf_shared.folders has those of components.
"""

from pathlib import Path

SOCKET = Path("/run/rtcfd/control.sock")
RUNTIME_DIR = Path("/run/rtcfd")
STATE_DIR = Path("/var/lib/rtcfd")
GRAPHS_DIR = Path("/etc/rtcfd/graphs.d")
EXECUTOR = Path("/usr/lib/rtcf/rtcf-executor")


def executor(build_tree: Path | None) -> Path:
    """Return the executor that belongs to this rtcfd."""
    return EXECUTOR if build_tree is None else build_tree / "bin" / "rtcf-executor"
