"""tools/affected: the tests that `make test ONLY=…` runs for a change."""

import subprocess
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from types import ModuleType

import pytest
from pages import TREE


@pytest.fixture(scope="module")
def affected() -> ModuleType:
    loader = SourceFileLoader("affected", str(TREE / "tools" / "affected"))
    spec = spec_from_loader("affected", loader)
    assert spec is not None
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module


def run(*names: str) -> tuple[int, list[str], str]:
    """Return the exit status, the lines for tests/run, and the error text."""
    done = subprocess.run(
        [TREE / "tools" / "affected", *names], cwd=TREE, capture_output=True, text=True
    )
    return done.returncode, done.stdout.splitlines(), done.stderr


def test_folders_and_their_tests_are_in_the_tree(affected: ModuleType) -> None:
    for folder, tests in affected.TESTS.items():
        assert (TREE / folder).exists(), folder
        for line in tests:
            kind, _, argument = line.partition(" ")
            assert kind in ("cpp", "python", "packages", "system")
            if kind == "python":
                assert (TREE / argument).exists(), line


def test_a_test_runs_alone_and_the_build_runs_all() -> None:
    this = "tests/unit/python/tree/test_affected.py"
    assert run(this) == (0, [f"python {this}"], "")
    everything = ["cpp .*", "packages", "python tests/integration", "python tests/unit/python"]
    assert run("CMakeLists.txt") == run("tests/support", this) == (0, [*everything, "system"], "")


def test_a_layer_has_the_tests_that_show_its_behaviour() -> None:
    status, lines, _ = run("daemon/executor/loop/cycle.cpp")
    assert status == 0
    assert {"cpp .*", "python tests/integration/loop"} <= set(lines)
    assert run("client/rtcfctl/main.py")[1] == [
        "python tests/integration/signals",
        "python tests/integration/terminal",
        "python tests/unit/python/rtcfctl",
        "python tests/unit/python/tree",
    ]


def test_a_path_outside_is_rejected() -> None:
    for name in ("/etc/passwd", "no/such/file"):
        status, lines, error = run(name)
        assert (status, lines) == (2, [])
        assert f"affected: {name} is not in this tree: name its files or folders" in error
    assert run()[0] == 2
