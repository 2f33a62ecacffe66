"""The measurements stated in docs/performance.md against new ones, and the benchmarks' methods.

Instructions are counted exactly: the counts are the same on any machine under any load.
"""

import itertools
import json
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from daemon_process import BUILD_TREE, clean_environment
from pages import TREE

PAGE = TREE / "docs" / "performance.md"
BENCH = TREE / "tests" / "bench"
TOLERANCE = 0.03  # relative, of a measurement
# Short-lived threads, each of which uses some CPU time; prints the total at the end.
THREADS = """
import sys, threading, time
taken = 0.0

def work():
    global taken
    while time.thread_time() < 0.02:
        pass
    taken += time.thread_time()

print("ready", flush=True)
for _ in sys.stdin:
    for _ in range(10):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    print(taken, flush=True)
"""
# Measures like a benchmark: the threads' CPU time in ms, and the measured cost.
COST_OF_THREADS = f"""
import subprocess, sys
from cost import cost_of

with subprocess.Popen([sys.executable, "-c", {THREADS!r}], stdin=subprocess.PIPE,
                      stdout=subprocess.PIPE, text=True) as process:
    process.stdout.readline()
    taken = []

    def work():
        process.stdin.write("go\\n")
        process.stdin.flush()
        taken.append(float(process.stdout.readline()))

    cost = cost_of(work, [process.pid])
    process.stdin.close()
print(1e3 * taken[0], cost.cpu)
"""
SHORT_THREADS = """
import threading
print("ready", flush=True)
while True:
    threads = [threading.Thread(target=int) for _ in range(20)]
    [each.start() for each in threads]
    [each.join() for each in threads]
"""
COST_WHILE_THREADS_END = f"""
import subprocess, sys
from cost import cost_of

with subprocess.Popen([sys.executable, "-c", {SHORT_THREADS!r}],
                      stdout=subprocess.PIPE) as process:
    process.stdout.readline()
    try:
        for _ in range(2000):
            cost_of(lambda: None, [process.pid])
    finally:
        process.kill()
"""


def bench(code: str) -> str:
    """Run code with the modules of the benchmarks; return its output."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=BENCH / "suite", timeout=60, check=True,
        env=clean_environment() | {"PYTHONPATH": str(BENCH / "suite")}, stdout=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    return done.stdout


def measured(folder: Path) -> list[dict[str, Any]]:
    """Run the benchmarks that count; return the results that have a budget."""
    # The build tree's own results stay untouched.
    (folder / "bench").mkdir()
    for part in ("bench/bin", "lib", "python"):
        (folder / part).symlink_to(BUILD_TREE / part)
    done = subprocess.run(
        [BENCH / "run", "instructions", "lines"], capture_output=True, text=True, timeout=300,
        env=clean_environment() | {"RTCF_BUILD": str(folder)},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    results = json.loads((folder / "bench" / "results.json").read_text())["results"]
    return [budget for result in results for budget in result["budgets"]]


def stated() -> dict[str, tuple[float, str]]:
    """Return the docs' results for this release's compiler, and whether each budget is met."""
    release = subprocess.check_output([TREE / "tools" / "release", "codename"], text=True).strip()
    lines = PAGE.read_text().splitlines()
    head = next(i for i, line in enumerate(lines) if line.startswith("| instructions of a cycle"))
    columns = cells(lines[head])
    if release not in columns:
        pytest.skip(f"{PAGE.name} states no counts for the compiler of {release}")
    place = columns.index(release)
    table = itertools.takewhile(lambda line: line.startswith("|"), lines[head + 2 :])
    rows = [cells(line) for line in table]
    return {row[0]: (float(row[place]), row[-1]) for row in rows}


def cells(line: str) -> list[str]:
    """Return the cells of a line of a table."""
    return [cell.strip() for cell in line.strip("|").split("|")]


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the counter is for x86-64")
def test_instructions_and_cache_lines_of_a_cycle_match_the_docs(tmp_path: Path) -> None:
    documented = stated()
    found = measured(tmp_path)
    assert documented.keys() == {each["text"] for each in found}
    for each in found:
        count, verdict = documented[each["text"]]
        # The stack and the heap begin at other places within a line in each run.
        moves = 2.0 if each["unit"] == "lines" else 0.0
        assert each["measured"] == pytest.approx(count, rel=TOLERANCE, abs=moves), each["text"]
        word = "kept" if each["kept"] else "over"
        assert verdict == f"{each['limit']:.0f}: {word}", each["text"]


def test_the_cost_of_a_process_includes_ended_threads() -> None:
    taken, cost = map(float, bench(COST_OF_THREADS).split())
    assert cost >= taken


def test_the_cost_of_a_process_is_read_while_threads_end() -> None:
    bench(COST_WHILE_THREADS_END)
