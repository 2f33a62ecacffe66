"""The budget of random tests, and the table of times: pytest with our conftest on other tests."""

import os
import re
import subprocess
from pathlib import Path

import pytest
from empty_tree import make_empty_tree

TESTS = """
import time
import pytest
from hypothesis import given, settings, strategies as st

def burn():
    end = time.process_time() + 0.02
    while time.process_time() < end:
        pass

@settings(max_examples=100, database=None)
@given(st.integers())
def test_light(x):
    burn()

@pytest.mark.random(3)
@settings(max_examples=100, database=None)
@given(st.integers())
def test_heavy(x):
    burn()

@pytest.mark.long
@settings(max_examples=100, database=None)
@given(st.integers())
def test_long(x):
    burn()

@settings(max_examples=100, database=None)
@given(st.integers())
def test_wrong(x):
    burn()
    assert False
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a source tree with these tests."""
    folder = make_empty_tree(tmp_path_factory.mktemp("tree"))
    (folder / "tests" / "test_it.py").write_text(TESTS)
    return folder


@pytest.mark.parametrize("workers", [0, 2])
def test_random_tests_share_a_budget(folder: Path, workers: int) -> None:
    table = folder / "build" / "test" / "times.tsv"
    table.unlink(missing_ok=True)
    done = subprocess.run(
        ["/usr/bin/python3", "-m", "pytest", "tests", *(["-n", str(workers)] if workers else [])],
        cwd=folder,
        env=os.environ | {"RTCF_RANDOM_S": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    # A counterexample is found within any share.
    assert "1 failed, 3 passed" in done.stdout
    said = dict(re.findall(r"^tests/test_it\.py::test_(\w+): (.*)$", done.stdout, re.MULTILINE))
    assert set(said) == {"light", "heavy", "wrong"}
    # A budget of 1 s in five parts; an example takes 0.02 s, and one more may begin at the end.
    light, heavy = (re.match(r"(\d+) examples, (\d+) left out in", said[name]) for name in
                    ("light", "heavy"))  # fmt: skip
    assert light
    assert heavy
    assert 1 <= int(light[1]) <= 11 < int(light[2])
    assert 1 <= int(heavy[1]) <= 31 < int(heavy[2])
    assert said["light"].endswith(" of 0.2 s")
    assert said["heavy"].endswith(" of 0.6 s")
    rows = {line.split("\t")[3]: line.split("\t")[:3] for line in table.read_text().splitlines()}
    assert set(rows) == {f"tests/test_it.py::test_{name}" for name in (*said, "long")}
    processor, elapsed, waited = map(float, rows["tests/test_it.py::test_long"])
    assert processor >= 2.0
    assert elapsed >= processor - 0.1
    assert waited == pytest.approx(max(elapsed - processor, 0.0), abs=0.02)
