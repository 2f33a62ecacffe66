"""The daemon and the client library are independent of each other."""

import subprocess
import sys

import pytest
from daemon_process import BUILD_TREE

_LIST = "import sys, {0}; print(*(name for name in sys.modules if name.startswith('{1}.')))"


def _imported_by(modules: str, package: str) -> set[str]:
    """Return the modules of a package that an import of others loads."""
    listed = subprocess.run(
        [sys.executable, "-c", _LIST.format(modules, package)],
        env={"PYTHONPATH": str(BUILD_TREE / "python")},
        capture_output=True,
        text=True,
        check=True,
    )
    return set(listed.stdout.split())


@pytest.mark.parametrize(
    "program", ["rtcfd.main", "rtcfd.incidents.writer, rtcfd.incidents.frame_file"]
)
def test_the_daemon_imports_no_client_library(program: str) -> None:
    loaded = _imported_by(program, "rtcf")
    assert {each for each in loaded if each.endswith("_pb2")}
    assert not {each for each in loaded if not each.startswith(("rtcf.v1", "rtcf.executor"))}


def test_the_client_library_imports_nothing_of_the_daemon() -> None:
    assert not _imported_by("rtcf.client, rtcfctl.main", "rtcfd")
