"""`rtcfctl check` with the executor that is built with RealtimeSanitizer, if it is."""

import json
import subprocess

import pytest
from daemon_process import BUILD_TREE, clean_environment

EXECUTOR = BUILD_TREE.with_name(f"{BUILD_TREE.name}-rtsan") / "bin" / "rtcf-executor"

pytestmark = pytest.mark.skipif(not EXECUTOR.exists(), reason=f"there is no {EXECUTOR}")


def check(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(BUILD_TREE / "bin" / "rtcfctl"), "check", *arguments],
        env=clean_environment(),
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("name", ["Mimo", "Identity", "PaperExample"])
def test_components_that_come_with_rtcf_are_clean(name: str) -> None:
    done = check("rtcf_examples", name)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout == f"rtcf_examples/{name}: clean in 1000 cycles\n"


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


def test_a_component_that_faults_is_refused() -> None:
    done = check("rtcf_faults", "NotFiniteStops")
    assert done.returncode == 1
    assert "is not finite" in done.stderr
