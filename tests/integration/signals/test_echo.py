"""`rtcfctl echo` on a running loop."""

import json
import signal
import subprocess
from pathlib import Path

import pytest
from daemon_process import BUILD_TREE, Daemon, clean_environment


def test_json_has_a_line_per_cycle(running: Daemon) -> None:
    done = running.ctl("echo", "wave", "-n", "50", "-o", "json")
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(lines) == 50
    numbers = [line["cycle"] for line in lines]
    assert numbers == list(range(numbers[0], numbers[0] + 50))
    assert set(lines[0]["values"]) == {"/wave.wave", "/wave.phase", "/wave.above"}
    assert isinstance(lines[0]["values"]["/wave.phase"], float)
    assert isinstance(lines[0]["values"]["/wave.above"], bool)


def test_text_has_a_few_cycles_per_second(running: Daemon) -> None:
    done = running.ctl("echo", "wave.wave", "--rate", "100Hz", "-n", "3")
    assert done.returncode == 0, done.stderr
    heads = [line for line in done.stdout.splitlines() if line.startswith("cycle ")]
    values = [line for line in done.stdout.splitlines() if line.startswith("  /wave.wave: ")]
    assert len(heads) == len(values) == 3
    first, second, third = (int(head.split()[1]) for head in heads)
    assert (second - first, third - second) == (10, 10)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("nobody",), 1, "nobody matches no output of fixed size and no state; available: "),
        (("wave", "-n", "0"), 2, "-n 0: at least 1"),
        (("wave", "--rate", "fast"), 2, "fast"),
    ],
)
def test_errors_are_one_line(running: Daemon, words: tuple[str, ...], code: int, said: str) -> None:
    done = running.ctl("echo", *words)
    assert done.returncode == code
    assert said in done.stderr.splitlines()[-1]


def test_ctrl_c_ends_it(running: Daemon) -> None:
    process = subprocess.Popen(
        [
            BUILD_TREE / "bin" / "rtcfctl",
            "--socket",
            running.socket,
            "echo",
            "wave",
            "-o",
            "json",
        ],
        stdout=subprocess.PIPE,
        env=clean_environment(),
    )
    assert process.stdout is not None
    assert process.stdout.readline()
    process.send_signal(signal.SIGINT)
    rest = process.stdout.read()
    assert process.wait() == 0
    assert not rest or rest.endswith(b"\n")


@pytest.mark.parametrize("verb", ["echo", "record"])
def test_a_note_says_that_the_loop_does_not_run(running: Daemon, tmp_path: Path, verb: str) -> None:
    assert running.ctl("stop").returncode == 0
    words = ["-o", str(tmp_path / "run.mcap")] if verb == "record" else []
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "--socket", running.socket, verb, *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=clean_environment(),
    )
    assert process.stderr is not None
    assert process.stderr.readline() == (
        "rtcfctl: note: the loop of rt_runner does not run: no values until it is started "
        "(`rtcfctl -r rt_runner start`)\n"
    )
    assert running.ctl("start").returncode == 0
    assert running.ctl("stop").returncode == 0
    said = process.stderr.readline()
    assert said.startswith("rtcfctl: note: the loop of rt_runner ended in cycle "), said
    process.send_signal(signal.SIGINT)
    assert process.wait() == 0
