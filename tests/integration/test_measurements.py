"""What docs/performance.md states, held to what is measured; and the benches' own measuring.

Instructions are counted one by one: they are the same on any machine, whatever else it does.
"""

import platform
import re
import subprocess
import sys
from pathlib import Path

import pytest
from daemon_process import BUILD_TREE
from pages import TREE

sys.path.append(str(TREE / "tests" / "bench" / "suite"))

import instructions
from cost import cost_of
from processes import output_of
from setting import Setting

PAGE = TREE / "docs" / "performance.md"
TOLERANCE = 0.03  # of a figure
# Threads that come and go, each of which takes some CPU time; says of how much when they ended.
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


def stated() -> dict[str, tuple[float, str]]:
    """Return the figures of the page for this release's compiler, and its word on each budget."""
    release = output_of([str(TREE / "tools" / "release"), "codename"]).strip()
    rows = [
        [cell.strip() for cell in line.strip("|\n").split("|")]
        for line in PAGE.read_text().splitlines()
        if line.startswith("|")
    ]
    head = next(i for i, row in enumerate(rows) if row[0] == "instructions of a cycle")
    columns = rows[head][1:]
    if release not in columns:
        pytest.skip(f"{PAGE.name} states no counts for the compiler of {release}")
    place = 1 + columns.index(release)
    found = {}
    for row in rows[head + 2 :]:
        if len(row) != len(rows[head]):
            break
        found[row[0]] = (float(row[place]), row[-1])
    return found


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the counter is for x86-64")
def test_instructions_of_a_cycle_are_those_that_the_page_states() -> None:
    figures = stated()
    measured = instructions.measured(Setting(BUILD_TREE, BUILD_TREE / "bench"))
    assert figures.keys() == {each.text for each in measured}
    for each in measured:
        figure, verdict = figures[each.text]
        assert each.measured == pytest.approx(figure, rel=TOLERANCE), each.text
        assert verdict == f"{each.limit:.0f}: {'kept' if each.kept else 'over'}", each.text


def test_the_cost_of_a_process_has_what_ended_threads_took() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", THREADS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        stdin, stdout = process.stdin, process.stdout
        taken = []

        def work() -> None:
            stdin.write("go\n")
            stdin.flush()
            taken.append(float(stdout.readline()))

        cost = cost_of(work, [process.pid])
        stdin.close()
    assert cost.cpu >= taken[0] * 1e3


def test_the_cost_of_a_process_is_read_while_threads_end(tmp_path: Path) -> None:
    script = tmp_path / "threads.py"
    script.write_text(
        "import threading\n"
        "while True:\n"
        "    threads = [threading.Thread(target=int) for _ in range(20)]\n"
        "    [each.start() for each in threads]\n"
        "    [each.join() for each in threads]\n"
    )
    with subprocess.Popen(["timeout", "60", sys.executable, script]) as wrapper:
        children = Path(f"/proc/{wrapper.pid}/task/{wrapper.pid}/children")
        while not (found := re.findall(r"\d+", children.read_text())):
            assert wrapper.poll() is None
        try:
            for _ in range(2000):
                cost_of(lambda: None, [int(found[0])])
        finally:
            wrapper.terminate()
