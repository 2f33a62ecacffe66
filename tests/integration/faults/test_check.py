"""`rtcfctl check` with the executor built with RealtimeSanitizer."""

import json
import subprocess
from pathlib import Path

import pytest
import rtcf
from daemon_process import BUILD_TREE, clean_environment
from pages import TREE
from rtcf.checking import sanitizer_options
from rtsan import EXECUTOR, HOW_TO_BUILD

PENDULUM = (
    "<robot name='pendulum'><link name='base'/><link name='bob'><inertial><mass value='1'/>"
    "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>"
    "<joint name='pivot' type='continuous'><parent link='base'/><child link='bob'/>"
    "<axis xyz='0 1 0'/></joint></robot>"
)
# Parameters of components that cannot be loaded without.
PARAMETERS = {
    "rtcf_control/GravityCompensation": [f"urdf:={PENDULUM}"],
    "rtcf_mujoco/Simulation": [f"model:={TREE / 'tests' / 'mujoco' / 'models' / 'arm.xml'}"],
}
OURS = {folder.name for folder in (TREE / "components").iterdir()}


def check(*arguments: str) -> subprocess.CompletedProcess[str]:
    assert EXECUTOR.exists(), HOW_TO_BUILD
    return subprocess.run(
        [str(BUILD_TREE / "bin" / "rtcfctl"), "check", *arguments],
        env=clean_environment(),
        capture_output=True,
        text=True,
        check=False,
    )


def test_all_components_of_rtcf_are_clean(client: rtcf.Client) -> None:
    types = [each for each in client.list_types().types if each.package in OURS]
    assert len(types) >= 3
    for each in types:
        name = f"{each.package}/{each.type}"
        parameters = [word for p in PARAMETERS.get(name, []) for word in ("--param", p)]
        done = check(each.package, each.type, *parameters)
        assert done.returncode == 0, done.stdout + done.stderr
        assert done.stdout == f"{name}: clean in 1000 cycles\n"


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
    (frame,) = [line for line in done.stdout.splitlines() if "/misbehaves.cpp:" in line]
    # addr2line reports only the innermost name of an inlined function.
    llvm = "llvm-symbolizer" in sanitizer_options()
    shown = f"(anonymous namespace)::{function}" if llvm else "fault"
    assert frame.strip().partition("  ")[0] == shown
    assert f"> void fault() override {{ {source}" in done.stdout
    found = json.loads(check("rtcf_faults", name, "-o", "json").stdout)
    assert found["violations"][0]["called"] == called


SINE = """\
import math

from rtcf.component import Component, Output


class Sine(Component):
    out: Output[float]

    def update(self):
        self.out.write(math.sin(self.dt))
"""
ALLOCATES = """\
#include <stdlib.h>
double sin(double x) {
    volatile char* bytes = malloc(64);
    bytes[0] = 1;
    free((void*)bytes);
    return x;
}
"""


def test_a_violation_below_a_component_in_python_is_shown_with_its_line(tmp_path: Path) -> None:
    source, package = tmp_path / "sine.py", tmp_path / "lib" / "py"
    source.write_text(SINE)
    (tmp_path / "sin.c").write_text(ALLOCATES)
    compiler = tmp_path / "c++"
    compiler.write_text(f'#!/bin/sh\nexec g++ "$@" {tmp_path}/sin.o\n')
    compiler.chmod(0o755)
    command = ["gcc", "-fno-builtin", "-fPIC", "-c", str(tmp_path / "sin.c")]
    subprocess.run(command, cwd=tmp_path, check=True)
    subprocess.run(
        [str(BUILD_TREE / "bin" / "rtcf-compile"), str(source), "-o", str(package / "sine.so")],
        env=clean_environment() | {"CXX": str(compiler)}, check=True,
    )  # fmt: skip
    done = check("py", "Sine", "--path", str(package.parent), "--cycles", "3")
    assert done.returncode == 1 and "malloc" in done.stdout, done.stderr
    assert f"{source}:10" in done.stdout
    assert "> self.out.write(math.sin(self.dt))" in done.stdout


def test_system_calls_for_devices_are_allowed() -> None:
    done = check("rtcf_test", "Device", "--cycles", "50")
    assert done.stdout == "rtcf_test/Device: clean in 50 cycles\n"


def test_a_failing_component_is_rejected() -> None:
    done = check("rtcf_faults", "NotFiniteStops")
    assert done.returncode == 1
    assert "is not finite" in done.stderr


def check_plainly(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Check in the ordinary executor, since this needs no sanitizer."""
    return subprocess.run(
        [str(BUILD_TREE / "bin" / "rtcfctl"), "check", *arguments,
         "--executor", str(BUILD_TREE / "bin" / "rtcf-executor")],
        env=clean_environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("NullDereference", "the component crashed while updating, from cycle 20 on: SIGSEGV"),
        ("CallsAbort", "the component crashed while updating, from cycle 20 on: SIGABRT"),
        ("CrashingConfigure", "the component crashed while configuring /checked: SIGSEGV"),
        ("CallsExit", "the component ended its process while updating, from cycle 20 on: exit"),
        (
            "NeverReturns",
            "the component does not return: no progress for 10 s while updating, from",
        ),
    ],
)
def test_the_cause_of_a_dead_process_is_reported(name: str, said: str) -> None:
    done = check_plainly("rtcf_faults", name)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f"rtcfctl: rtcf_faults/{name}: {said}")


def test_outputs_with_nan_are_reported() -> None:
    done = check_plainly("rtcf_faults", "WritesNan", "--cycles", "50")
    assert "rtcf_faults/WritesNan: output value had NaN or infinity\n" in done.stdout
    found = json.loads(check_plainly("rtcf_faults", "WritesNan", "-o", "json").stdout)
    assert found["not_finite"] == ["value"]
    assert check_plainly("rtcf_faults", "WritesNan", "--cycles", "9").stdout == (
        "rtcf_faults/WritesNan: clean in 9 cycles\n"
    )
