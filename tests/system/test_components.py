"""The packages' own tests (autopkgtest), in the booted machine."""

from pathlib import Path

import pytest
from machine import Machine
from rtcf_service import Service

TESTS = Path(__file__).parents[2] / "debian" / "tests"


@pytest.fixture(scope="module")
def folder(machine: Machine) -> str:
    for file in sorted(TESTS.rglob("*")):
        if file.is_file():
            copy = machine.path(f"/srv/tests/{file.relative_to(TESTS)}")
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(file.read_bytes())
            copy.chmod(file.stat().st_mode)
    return "/srv/tests"


@pytest.mark.parametrize("name", ["run-time", "build-component"])
def test_it_passes(machine: Machine, folder: str, name: str) -> None:
    machine.run(f"{folder}/{name}")


def test_all_autopkgtests_are_run_here() -> None:
    control = (TESTS / "control").read_text()
    names = [line.split()[1] for line in control.splitlines() if line.startswith("Tests:")]
    assert sorted(names) == ["build-component", "run-time"]


@pytest.mark.parametrize("language", [(), ("--python",)], ids=["C++", "Python"])
def test_a_new_package_builds_with_the_printed_commands(
    service: Service, language: tuple[str, ...]
) -> None:
    machine = service.machine
    folder = machine.run("mktemp", "-d", user="alice").stdout.strip()
    new = " ".join(["rtcfctl new my_arm Gain", *language])
    lines = machine.shell(f"cd {folder} && {new}", user="alice").stdout.splitlines()
    change, build, test, *_ = [line for line in lines if line.startswith("  ")]
    done = machine.shell(f"cd {folder} && set -e\n{change}\n{build}\n{test}", user="alice")
    assert "100% tests passed, 0 tests failed out of 1" in done.stdout
