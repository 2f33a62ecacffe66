"""`rtcfctl check` with the executor that is built with RealtimeSanitizer."""

import json
import subprocess
from pathlib import Path

import pytest
import rtcf
from daemon_process import BUILD_TREE, clean_environment
from rtsan import EXECUTOR, HOW_TO_BUILD

OURS = {folder.name for folder in (Path(__file__).parents[2] / "components").iterdir()}


def check(*arguments: str) -> subprocess.CompletedProcess[str]:
    assert EXECUTOR.exists(), HOW_TO_BUILD
    return subprocess.run(
        [str(BUILD_TREE / "bin" / "rtcfctl"), "check", *arguments],
        env=clean_environment(),
        capture_output=True,
        text=True,
        check=False,
    )


def test_all_components_that_come_with_rtcf_are_clean(client: rtcf.Client) -> None:
    types = [each for each in client.list_types().types if each.package in OURS]
    assert len(types) >= 3
    for each in types:
        done = check(each.package, each.type)
        assert done.returncode == 0, done.stdout + done.stderr
        assert done.stdout == f"{each.package}/{each.type}: clean in 1000 cycles\n"


@pytest.mark.parametrize(
    ("name", "called", "function", "source"),
    [
        ("Allocates", "malloc", "Allocates::fault()", "std::vector<char>(kBytes, 1)"),
        ("Sleeps", "nanosleep", "Sleeps::fault()", "std::this_thread::sleep_for"),
    ],
)
def test_a_violation_is_shown_with_its_stack_and_line(
    name: str, called: str, function: str, source: str
) -> None:
    done = check("rtcf_faults", name, "--cycles", "50", "--param", "after:=2")
    assert done.returncode == 1
    assert called in done.stdout
    (frame,) = [line for line in done.stdout.splitlines() if function in line]
    assert "/misbehaves.cpp:" in frame
    assert f"> void fault() override {{ {source}" in done.stdout
    found = json.loads(check("rtcf_faults", name, "-o", "json").stdout)
    assert found["violations"][0]["called"] == called


def test_what_a_component_does_with_its_device_is_allowed() -> None:
    done = check("rtcf_test", "Device", "--cycles", "50")
    assert done.stdout == "rtcf_test/Device: clean in 50 cycles\n"


def test_a_component_that_faults_is_refused() -> None:
    done = check("rtcf_faults", "NotFiniteStops")
    assert done.returncode == 1
    assert "is not finite" in done.stderr
