"""`rtcfctl new`: the new package builds, passes its test and runs with the printed commands."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rtcf
from daemon_process import BUILD_TREE, clean_environment, wait_for
from launch_processes import build_tree_environment

_DEADLINE_S = 600.0  # for compilers on a busy machine
Done = subprocess.CompletedProcess[str]


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    return clean_environment() | {
        "PATH": f"{BUILD_TREE / 'bin'}:{os.environ['PATH']}",
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
        # Replaces librtcf-dev.
        "rtcf_DIR": str(BUILD_TREE / "cmake" / "rtcf"),
        "CXXFLAGS": "-O0",
    }


def type_(line: str, folder: Path, environment: dict[str, str]) -> Done:
    return subprocess.run(
        ["bash", "-c", line], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=_DEADLINE_S,
    )  # fmt: skip


@contextmanager
def running(line: str, folder: Path, environment: dict[str, str]) -> Iterator[None]:
    """Run a command line until Ctrl-C."""
    said = folder / "said"
    with (
        said.open("wb") as to,
        subprocess.Popen(
            ["bash", "-c", f"exec {line}"], cwd=folder, env=environment,
            stdout=to, stderr=to,
        ) as process,
    ):  # fmt: skip
        try:
            wait_for(
                lambda: "Ctrl-C ends it" in said.read_text() or process.poll() is not None, line
            )
            assert process.poll() is None, said.read_text()
            yield
        finally:
            process.send_signal(signal.SIGINT)


@pytest.mark.parametrize("language", [(), ("--python",)], ids=["C++", "Python"])
def test_the_printed_commands_build_test_and_run_it(
    tmp_path: Path, environment: dict[str, str], language: tuple[str, ...]
) -> None:
    made = type_(" ".join(["rtcfctl new my_arm PDControl", *language]), tmp_path, environment)
    assert made.returncode == 0, made.stderr
    assert all(len(line) <= 80 for line in made.stdout.splitlines())
    lines = [
        line.strip().replace("/tmp/rtcf.sock", str(tmp_path / "s"))
        for line in made.stdout.splitlines()
        if line.startswith("  ")
    ]
    change, build, test, run, *others = lines
    done = type_(f"set -e\n{change}\n{build}\n{test}", tmp_path, environment)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "100% tests passed, 0 tests failed out of 1" in done.stdout
    folder = tmp_path / "my_arm"
    with running(run, folder, environment):
        for line in others:
            done = type_(line, folder, environment)
            assert done.returncode == 0, done.stderr
        with rtcf.Client(tmp_path / "s") as client:
            (gain,) = (
                each
                for each in client.get_component("pd_control").parameters
                if each.name == "gain"
            )
            client.stop()
    assert gain.value.double_value == 2.0


def test_its_test_fails_if_the_component_is_wrong(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    assert type_("rtcfctl new my_arm Gain --python", tmp_path, environment).returncode == 0
    source = tmp_path / "my_arm" / "src" / "gain.py"
    source.write_text(source.read_text().replace("self.gain * error", "-self.gain * error"))
    environment["PYTHONPATH"] = str(BUILD_TREE / "python")
    tried = type_("cd my_arm && /usr/bin/python3 -m pytest", tmp_path, environment)
    assert tried.returncode == 1
    assert "2 failed" in tried.stdout


def test_catkin_builds_it(tmp_path: Path, environment: dict[str, str]) -> None:
    (tmp_path / "src").mkdir()
    for line in ("new my_arm PDControl", "new my_leg Gain --python"):
        assert type_(f"rtcfctl {line}", tmp_path / "src", environment).returncode == 0
    done = type_(
        "catkin_make -DPYTHON_EXECUTABLE=/usr/bin/python3", tmp_path,
        build_tree_environment(environment),
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    for package in ("my_arm", "my_leg"):
        place = tmp_path / "devel" / "lib" / "rtcf-components" / package
        assert [each.name for each in place.iterdir()] == [f"{package}.so"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("Arm Pi", "package 'Arm': use lower-case letters, digits and _, e.g. my_arm"),
        ("../arm Pi", "package '../arm': use lower-case letters"),
        ("my__arm Pi", "package 'my__arm': use lower-case letters"),
        ("test Pi", "package test: CMake has a target of this name; choose another"),
        ("my_arm pi", "component 'pi': use letters and digits with a capital first"),
        ("my_arm 'Pi;'", "component 'Pi;': use letters and digits"),
        ("my_arm Input", "component Input: rtcf has a class of this name"),
        ("my_arm Json --python", "its module json.py would hide Python's module json"),
        ("there Pi", "there exists: choose another name, or move it"),
    ],
)
def test_errors_are_one_line_and_leave_no_file(
    tmp_path: Path, environment: dict[str, str], words: str, said: str
) -> None:
    (tmp_path / "there").mkdir()
    done = type_(f"rtcfctl new {words}", tmp_path, environment)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("rtcfctl: ") and said in line
    assert os.listdir(tmp_path) == ["there"]


def test_json_lists_the_created_files(tmp_path: Path, environment: dict[str, str]) -> None:
    done = type_("rtcfctl -o json new my_arm Pi", tmp_path, environment)
    told = json.loads(done.stdout)
    assert told["folder"] == str(tmp_path / "my_arm")
    for file in told["files"]:
        assert (tmp_path / "my_arm" / file).is_file()
    refused = type_("chmod 0500 . && setpriv --reuid=54321 --clear-groups "
                    "rtcfctl new my_leg Pi", tmp_path, environment)  # fmt: skip
    assert refused.returncode == 1
    assert refused.stderr == "rtcfctl: my_leg: Permission denied\n"
