"""`rtcfctl wait`, `get` and `hz` on a running loop."""

import json
import time

import pytest
import rtcf
from daemon_process import DEADLINE_S, Daemon
from rtcf.streams.condition import Condition


def test_wait_finds_a_condition_that_holds_for_one_cycle(running: Daemon) -> None:
    # A phase of 1 Hz is that small in one of 1000 cycles.
    done = running.ctl("wait", "wave.phase", "< 0.0005", "--timeout", f"{DEADLINE_S}s")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("true in cycle ")
    done = running.ctl("wait", "wave.phase < 0.0005 and wave.wave < 1", "-o", "json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout).keys() == {"cycle", "stamp_ns"}


def test_wait_times_out(running: Daemon) -> None:
    begin = time.monotonic()
    done = running.ctl("wait", "wave.phase > 2", "--timeout", "300ms")
    assert done.returncode == 1
    assert done.stderr == "rtcfctl: wave.phase > 2: not true in any cycle for 0.3 s\n"
    assert time.monotonic() - begin >= 0.3


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("wait", "wave.phase >"), 2, '"wave.phase >" is not a condition'),
        (("wait", "nobody.x > 1"), 1, "nobody.x matches no output of fixed size and no state"),
        (("wait", "wave.phase > 1", "--timeout", "0"), 2, "--timeout 0: more than 0 s"),
        (("wait", "wave.phase > 1", "--timeout", "soon"), 2, "soon"),
        (("wait", "wave.phase[1] > 1"), 2, "/wave.phase[1] is not a number of this stream"),
        (("get", "nobody"), 1, "/nobody"),
        (("get", "wave.nothing"), 1, "/wave has no nothing; it has amplitude, rate, "),
        (("hz", "wave", "-n", "0"), 2, "-n 0: at least 1"),
        (("hz", "wave", "--window", "0"), 2, "--window 0: more than 0, at most 3600 s"),
        (("hz", "nobody"), 1, "nobody matches no output of fixed size and no state"),
    ],
)
def test_errors_are_one_line(running: Daemon, words: tuple[str, ...], code: int, said: str) -> None:
    done = running.ctl(*words)
    assert done.returncode == code, done.stderr
    assert said in done.stderr.splitlines()[-1]


def test_get_prints_parameters_ports_and_state(running: Daemon) -> None:
    assert running.ctl("get", "wave.rate").stdout == "1\n"
    assert json.loads(running.ctl("get", "wave.rate", "-o", "json").stdout) == 1.0
    assert 0 <= json.loads(running.ctl("get", "wave.phase", "-o", "json").stdout) <= 1
    told = json.loads(running.ctl("get", "/wave", "-o", "json").stdout)
    assert told.keys() == {"amplitude", "rate", "shape", "silent", "wave", "phase", "above"}
    lines = running.ctl("get", "wave").stdout.splitlines()
    assert "shape: sine" in lines


def test_hz_prints_the_rates_of_change(running: Daemon) -> None:
    done = running.ctl("hz", "wave", "-n", "1", "-o", "json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["seconds"] >= 1.0
    changes = told["changes_hz"]
    # In each cycle, and twice per wave, of the observed cycles.
    cycles = told["cycles_hz"]
    assert 0.9 * cycles <= changes["/wave.phase"] <= 1.1 * cycles
    assert changes["/wave.above"] <= 4
    text = running.ctl("hz", "wave.phase", "-n", "1").stdout
    assert text.startswith("cycles: ") and "/wave.phase" in text


def test_a_condition_has_json_output(running: Daemon) -> None:
    condition = Condition("wave.phase > 0.25 and not wave.above")
    with (
        rtcf.Client(running.socket) as client,
        client.watch_ports([*condition.columns, "wave.wave"]) as stream,
    ):
        condition.check(stream.schema)
        for batch in stream:
            where = condition.where(batch)
            assert len(where) == len(batch)
            assert (batch["/wave.phase"][where] > 0.25).all()
            if where.any():
                return
