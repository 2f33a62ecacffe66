"""The worker that keeps the compiler imported for rtcfctl."""

import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from daemon_process import BUILD_TREE
from processor_time import descendants
from rtcfctl.graph.compiler import SingleCompiler, WarmCompiler

COMMAND = str(BUILD_TREE / "bin" / "rtcf-compile")
DEADLINE_S = 600.0
COUNTS = """\
from rtcf.component import Component, Output


class Counts(Component):
    y: Output[float]

    def update(self):
        self.y.write(1.0)
"""


@pytest.fixture
def compiler() -> Iterator[WarmCompiler]:
    with WarmCompiler(lambda: COMMAND, lambda: "1") as compiler:
        yield compiler


def _run(compiler: WarmCompiler, *words: object) -> tuple[int, list[str]]:
    return compiler.run(list(map(str, words)), lambda line: None)


def _workers() -> list[int]:
    found = []
    for each in descendants(os.getpid()):
        command = Path(f"/proc/{each}/cmdline").read_bytes().split(b"\0")
        if b"--worker" in command:
            found.append(each)
    return found


def _ends(process: int) -> bool:
    return bool(select.select([os.pidfd_open(process)], [], [], DEADLINE_S)[0])


def test_it_answers_like_the_command(compiler: WarmCompiler, tmp_path: Path) -> None:
    source = tmp_path / "counts.py"
    for text in (COUNTS, COUNTS.replace("1.0", "one"), COUNTS + "    x = = 1\n", "import absent\n"):
        source.write_text(text)
        words = [str(source), "--verify", "50"]
        assert _run(compiler, *words) == SingleCompiler(COMMAND).run(words, lambda line: None)
    assert _run(compiler, "--verify", "?", source)[0] == 2


IMPORTING = """\
import {module}
from rtcf.component import Component, Output

VALUE = {module}.VALUE


class Counts(Component):
    y: Output[float]

    def update(self):
        self.y.write(VALUE)
"""


def test_a_component_leaves_nothing_in_the_worker(compiler: WarmCompiler, tmp_path: Path) -> None:
    source, helper = tmp_path / "counts.py", tmp_path / "helper.py"
    source.write_text(IMPORTING.format(module="helper"))
    for value, status in (("1.0", 0), ("'text'", 1), ("2.0", 0)):
        helper.write_text(f"VALUE = {value}\n")
        assert _run(compiler, source, "--verify", "50")[0] == status
    (worker,) = _workers()
    assert not descendants(worker)


def test_a_module_beside_the_source_hides_one_that_the_worker_has_imported(
    compiler: WarmCompiler, tmp_path: Path
) -> None:
    source = tmp_path / "counts.py"
    source.write_text(IMPORTING.format(module="timeit"))  # numba imports it
    status, (line,) = _run(compiler, source, "--verify", "50")
    assert status == 1 and "has no attribute 'VALUE'" in line
    (tmp_path / "timeit.py").write_text("VALUE = 1.0\n")
    assert _run(compiler, source, "--verify", "50") == (0, [])


def test_a_crash_is_one_line_and_the_worker_goes_on(compiler: WarmCompiler, tmp_path: Path) -> None:
    source = tmp_path / "crashing.py"
    source.write_text("import os, signal\n\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    before = _run(compiler, source, "--verify", "50")
    (worker,) = _workers()
    assert before[0] == 1
    (line,) = before[1]
    assert line.endswith("crashing.py: the compiler ended with SIGSEGV: "
                         "write this function in another way")  # fmt: skip
    source.write_text(COUNTS)
    assert _run(compiler, source, "--verify", "50") == (0, [])
    assert _workers() == [worker]


def test_a_worker_that_has_ended_is_replaced(compiler: WarmCompiler, tmp_path: Path) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS)
    assert _run(compiler, source, "--verify", "50") == (0, [])
    (first,) = _workers()
    os.kill(first, signal.SIGKILL)
    assert _run(compiler, source, "--verify", "50") == (0, [])
    (second,) = _workers()
    assert second != first
    compiler.end()
    assert _workers() == []


def test_a_worker_of_another_version_is_replaced(tmp_path: Path) -> None:
    source, version = tmp_path / "counts.py", ["1"]
    source.write_text(COUNTS)
    with WarmCompiler(lambda: COMMAND, lambda: version[0]) as compiler:
        assert _run(compiler, source, "--verify", "50") == (0, [])
        (first,) = _workers()
        version[0] = "2"
        assert _run(compiler, source, "--verify", "50") == (0, [])
        assert _workers() != [first]


def test_it_ends_with_rtcfctl_even_while_it_compiles(tmp_path: Path) -> None:
    # The module waits for a writer of the FIFO, and tells its process before.
    source, fifo, pid_file = (tmp_path / name for name in ("waiting.py", "fifo", "pid"))
    os.mkfifo(fifo)
    os.mkfifo(pid_file)
    source.write_text(
        "import os\n\n"
        f"open({str(pid_file)!r}, 'w').write(str(os.getpid()))\nopen({str(fifo)!r}).read()\n"
    )
    program = (
        "from rtcfctl.graph.compiler import WarmCompiler\n"
        f"WarmCompiler(lambda: {COMMAND!r}, lambda: '').run([{str(source)!r}, '--verify'], print)\n"
    )
    environment = {"PYTHONPATH": str(BUILD_TREE / "python"), "PATH": "/usr/bin:/bin"}
    rtcfctl = subprocess.Popen([sys.executable, "-c", program], env=environment)
    child = int(pid_file.read_text())
    (worker,) = descendants(rtcfctl.pid)[:1]
    rtcfctl.kill()
    rtcfctl.wait()
    assert _ends(worker) and _ends(child)


def test_it_ends_when_idle_and_has_a_low_priority() -> None:
    program = (
        "from rtcf_compile import worker\nworker.IDLE_S = 0.1\n"
        "import os\nstatus = worker.serve()\nprint(status, os.nice(0))\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program],
        env={"PYTHONPATH": str(BUILD_TREE / "python"), "PATH": "/usr/bin:/bin"},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.read() == f"0 {os.nice(0) + 5}\n"
