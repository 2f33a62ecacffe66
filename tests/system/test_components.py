"""The packages' own tests (autopkgtest), in the booted machine."""

from pathlib import Path

import pytest
from machine import Machine

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


def test_all_of_them_are_run_here() -> None:
    control = (TESTS / "control").read_text()
    names = [line.split()[1] for line in control.splitlines() if line.startswith("Tests:")]
    assert sorted(names) == ["build-component", "run-time"]
