"""tests/run with tests that fail by chance, find a counterexample, or hang."""

import re
import subprocess
from pathlib import Path

import pytest
from empty_tree import make_empty_tree
from pages import TREE

# The first run fails, each later one passes; a file tells the process which run it is.
HEAD = """
import atexit
from pathlib import Path
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

FIRST = not Path("ran").exists()
atexit.register(Path("ran").touch)

"""
PROPERTY = """
@given(st.integers())
def test_property(x):
    assert x < 1000 or not FIRST

"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a source tree without tests."""
    return make_empty_tree(tmp_path)


def run_tests(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Run pytest on a file like tests/run, with its own functions."""
    (folder / "tests" / "test_it.py").write_text(text)
    functions = "/^most_by_chance=/p; /^once_more() {/,/^}/p; /^with_pytest() {/,/^}/p"
    script = f"""
        long_marker='not long'
        hang=(--timeout 3)
        eval "$(sed -n '{functions}' {TREE}/tests/run)"
        with_pytest /usr/bin/python3 -m pytest tests
    """
    return subprocess.run(
        ["bash", "-c", script], cwd=folder, capture_output=True, text=True, timeout=120
    )


def test_a_counterexample_fails_without_repetition(folder: Path) -> None:
    done = run_tests(folder, HEAD + PROPERTY + "def test_other():\n    assert not FIRST\n")
    assert done.returncode == 1, done.stdout
    noted = "counterexample (kept in build/hypothesis): tests/test_it.py::test_property"
    assert f"make test: {noted}\n" in done.stdout
    assert "once more" not in done.stdout
    assert done.stdout.count("test session starts") == 1


def test_a_counterexample_is_tried_first_by_the_next_run(folder: Path) -> None:
    assert run_tests(folder, HEAD + PROPERTY).returncode == 1
    (folder / "ran").unlink()
    # No new draws: the kept example fails.
    reuse = "@settings(phases=[Phase.reuse])\n"
    done = run_tests(folder, HEAD + reuse + PROPERTY.lstrip())
    assert done.returncode == 1, done.stdout
    assert re.search(r"x=1000\b", done.stdout)


def test_any_other_failure_is_repeated(folder: Path) -> None:
    done = run_tests(folder, HEAD + "def test_other():\n    assert not FIRST\n")
    assert done.returncode == 0, done.stdout
    assert "make test: once more: tests/test_it.py::test_other\n" in done.stdout


def test_a_failure_that_cannot_be_reproduced_is_no_counterexample(folder: Path) -> None:
    once = """
@given(st.integers())
def test_property(x):
    global FIRST
    first, FIRST = FIRST, False
    assert not first
"""
    done = run_tests(folder, HEAD + once)
    assert done.returncode == 0, done.stdout
    assert "make test: once more: tests/test_it.py::test_property\n" in done.stdout


def test_a_test_that_hangs_fails_at_once_with_its_stack(folder: Path) -> None:
    hangs = "import threading\n\n\ndef test_hangs():\n    threading.Event().wait()\n"
    done = run_tests(folder, hangs + "\n\ndef test_later():\n    print('later')\n")
    assert done.returncode == 1
    before, failure, _ = done.stdout.partition("tests/test_it.py::test_hangs: failed in call\n")
    assert failure and "FAILURES" not in before
    assert "Failed: Timeout >3.0s" in done.stdout
    assert "1 failed, 1 passed" in done.stdout
