"""`rtcfctl trace --kernel` with causes of random kind and name, on PREEMPT_RT."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
import rtcf
from loop_2khz import Loop, limit_of_real_time
from machine import wait_for

SEED = 25
TRIALS = 100
DOUBT = "though the loop is more urgent"  # the trace cannot distinguish several causes
TRACEFS = Path("/sys/kernel/tracing")
# Uses the CPU once, and ends. Arguments: priority, time (s), name.
HOG = """
import os, sys, time
priority, seconds, name = int(sys.argv[1]), float(sys.argv[2]), sys.argv[3]
open("/proc/self/comm", "w").write(name)
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
until = time.monotonic() + seconds
while time.monotonic() < until:
    pass
"""
# One timer interrupt wakes COUNT threads below the loop. Argument: COUNT.
SLEEPERS = """
import ctypes, os, sys, time
count = int(sys.argv[1])
libc = ctypes.CDLL(None)
at = time.monotonic() + 0.5 + 0.02 * count
wanted = (ctypes.c_long * 2)(int(at), int(at % 1 * 1e9))
for _ in range(count):
    if os.fork() == 0:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        libc.clock_nanosleep(time.CLOCK_MONOTONIC, 1, wanted, None)
        os._exit(0)
assert time.monotonic() < at, "too slow"
for _ in range(count):
    assert os.wait()[1] == 0
"""


@dataclass(frozen=True)
class Culprit:
    """One cause of a late cycle, and a part of its name in a trace."""

    kind: str
    named: str  # part of the trace's text
    act: Callable[[], None]


@dataclass(frozen=True)
class Trial:
    """A cause, and the range of cycles in which it acted."""

    culprit: Culprit
    first: int
    last: int


class Culprits:
    """Causes of late cycles, drawn at random."""

    def __init__(self, client: rtcf.Client, draw: random.Random) -> None:
        self._client, self._draw, self._turn = client, draw, 0

    def next(self) -> Culprit:
        """Return a cause of a random kind."""
        kinds = (
            self._thread, self._interrupts, self._throttled, self._faults, self._sleep, self._gap
        )  # fmt: skip
        return self._draw.choice(kinds)()

    def _thread(self) -> Culprit:
        letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_/:() "
        name = "".join(self._draw.choice(letters) for _ in range(self._draw.randint(1, 13)))
        name = f"x{name.strip()}x"
        priority = self._draw.randint(84, 98)
        seconds = self._draw.uniform(0.001, 0.01)
        words = f"thread {name} (pid"
        return Culprit("thread", words, lambda: run(HOG, priority, seconds, name))

    def _throttled(self) -> Culprit:
        priority = self._draw.randint(1, 70)
        return Culprit(
            "throttled", "a limit of CPU time", lambda: run(HOG, priority, 2.2, "below the loop")
        )

    def _interrupts(self) -> Culprit:
        count = self._draw.randint(300, 500)
        return Culprit("interrupt", "timer", lambda: run(SLEEPERS, count))

    def _faults(self) -> Culprit:
        return self._stumble("page fault", "page fault", pages=self._draw.randint(1000, 4096))

    def _sleep(self) -> Culprit:
        return self._stumble(
            "blocked", "slept in a system call", sleep_us=self._draw.randint(1000, 10_000)
        )

    def _gap(self) -> Culprit:
        """Return a cause that the kernel does not see: an SMI looks like a slow component."""
        return self._stumble("unknown", "unknown", spin_us=self._draw.randint(1000, 10_000))

    def _stumble(self, kind: str, named: str, **values: int) -> Culprit:
        self._turn += 1
        chosen = {"pages": 0, "sleep_us": 0, "spin_us": 0, "turn": self._turn} | values
        settings = [rtcf.parse_parameter(f"{name}:={value}") for name, value in chosen.items()]

        def act() -> None:
            self._client.set_parameters("stumbles", settings)

        return Culprit(kind, named, act)


def run(program: str, *arguments: object) -> None:
    """Run a Python program to its end."""
    subprocess.run([sys.executable, "-I", "-S", "-c", program, *map(str, arguments)], check=True)


@contextmanager
def traced(folder: Path) -> Iterator[list[dict[str, object]]]:
    """Yield a list that contains the late cycles of the trace after the block."""
    if not os.path.ismount(TRACEFS):
        subprocess.run(["mount", "-t", "tracefs", "tracefs", str(TRACEFS)], check=True)
    file = folder / "trace.json"
    tracing = subprocess.Popen(
        ["rtcfctl", "trace", "-o", str(file), "--kernel", "--output", "json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip

    def begun() -> bool:
        assert tracing.poll() is None, tracing.communicate()
        parts = list(folder.glob(f".{file.name}.*.part"))
        return bool(parts) and '"ph": "X"' in parts[0].read_text()

    wait_for(begun, "the first cycles", 300)
    found: list[dict[str, object]] = []
    yield found
    tracing.send_signal(signal.SIGINT)
    said, error = tracing.communicate(timeout=600)
    assert tracing.returncode == 0, error
    found += json.loads(said)["kernel"]


@pytest.fixture
def limited() -> Iterator[None]:
    """Limit the time of real-time threads, as kernels do by default."""
    with limit_of_real_time(950_000):
        yield


def test_95_of_100_causes_are_named_correctly(loop: Loop, tmp_path: Path, limited: None) -> None:
    draw = random.Random(SEED)
    trials = []
    with rtcf.Client() as client:
        client.load(rtcf.component("rtcf_faults", "Stumbles", name="stumbles"))
        culprits = Culprits(client, draw)
        with traced(tmp_path) as found:
            for _ in range(TRIALS):
                culprit = culprits.next()
                first = loop.now().iteration
                culprit.act()
                time.sleep(0.05)
                trials.append(Trial(culprit, first, loop.now().iteration))
    verdicts = {"right": 0, "unknown": 0, "wrong": 0, "on time": 0}
    for trial in trials:
        words = [
            str(each["instead"])
            for each in found
            if trial.first <= int(str(each["cycle"])) <= trial.last
            and each["kind"] != "previous cycle"
        ]
        if not words:
            verdict = "on time"
        elif any(trial.culprit.named in each and DOUBT not in each for each in words):
            verdict = "right"
        else:
            is_unknown = all("unknown" in each or DOUBT in each for each in words)
            verdict = "unknown" if is_unknown else "wrong"
        verdicts[verdict] += 1
        print(verdict, trial.culprit.kind, repr(trial.culprit.named), sorted(set(words)))
    print(verdicts)
    late = sum(verdicts.values()) - verdicts["on time"]
    assert late >= 0.8 * TRIALS, "share of causes that delay a cycle"
    assert verdicts["right"] >= 0.95 * late
    assert verdicts["wrong"] <= 0.02 * late
