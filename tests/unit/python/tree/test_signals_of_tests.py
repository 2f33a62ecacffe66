"""Signals of programs that tests start."""

import subprocess
from pathlib import Path

import pytest
from empty_tree import make_empty_tree

TESTS = """
import signal
import subprocess
import pytest

@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGINT, signal.SIGQUIT])
def test_a_program_ends(number):
    with subprocess.Popen(["sleep", "60"]) as program:
        program.send_signal(number)
        assert program.wait(30) == -number
"""


@pytest.mark.parametrize("workers", [[], ["-n", "2"]])
def test_programs_end_by_signals_that_the_tests_themselves_ignore(
    tmp_path: Path, workers: list[str]
) -> None:
    tree = make_empty_tree(tmp_path)
    (tree / "tests" / "test_it.py").write_text(TESTS)
    # As under nohup, or in the background of a script.
    ignoring = ["env", "--ignore-signal=HUP,INT,QUIT"]
    done = subprocess.run(
        [*ignoring, "/usr/bin/python3", "-m", "pytest", *workers, "tests"],
        cwd=tree, stdout=subprocess.PIPE, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert "3 passed" in done.stdout
    assert done.returncode == 0
