"""`rtcf_add_components` in a user's package, with the build tree's find_package."""

import json
import subprocess
from pathlib import Path

import pytest
from daemon_process import BUILD_TREE
from pages import TREE

PACKAGE = TREE / "debian" / "tests" / "offset"


def _configure(folder: Path, *options: str) -> tuple[str, str]:
    """Return CMake's output, and the command that compiles the component."""
    done = subprocess.run(
        ["cmake", "-S", PACKAGE, "-B", folder, f"-Drtcf_DIR={BUILD_TREE / 'cmake' / 'rtcf'}",
         "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", *options],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (entry,) = json.loads((folder / "compile_commands.json").read_text())
    return done.stdout, entry["command"]


def test_a_build_without_a_type_is_optimised_with_lines_and_a_note(tmp_path: Path) -> None:
    said, command = _configure(tmp_path)
    assert "rtcf: CMAKE_BUILD_TYPE is not set: components are built as with RelWithDebInfo" in said
    assert {"-O2", "-g", "-DNDEBUG"} <= set(command.split())


@pytest.mark.parametrize("build_type", ["Debug", "Release"])
def test_a_given_build_type_is_used(tmp_path: Path, build_type: str) -> None:
    said, command = _configure(tmp_path, f"-DCMAKE_BUILD_TYPE={build_type}")
    assert "rtcf:" not in said
    assert "-O2" not in command.split()
