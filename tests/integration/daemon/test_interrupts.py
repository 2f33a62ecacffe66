"""KeyboardInterrupt in a call of the client library: the next calls work."""

from __future__ import annotations

import subprocess

import rtcf
from daemon_process import BUILD_TREE, DEADLINE_S, Daemon

# Interrupts a change at a random instant, then makes another one.  Python swallows an exception in
# __del__, so the interrupts are repeated.
INTERRUPTS = """
import random, signal, sys, time
import rtcf

def interrupt(number, frame):
    raise KeyboardInterrupt

def set_rate(client, rate):
    client.set_parameters("wave", [rtcf.parse_parameter(f"rate:={rate}")])

signal.signal(signal.SIGALRM, interrupt)
interrupts, until = 0, time.monotonic() + float(sys.argv[1])
with rtcf.Client() as client:
    while time.monotonic() < until:
        try:
            signal.setitimer(signal.ITIMER_REAL, random.uniform(0.0001, 0.004), 1.0)
            while True:
                set_rate(client, random.uniform(1.0, 5.0))
        except KeyboardInterrupt:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            interrupts += 1
        set_rate(client, 2.5)
        component = client.get_component("wave")
        (rate,) = (each for each in component.parameters if each.name == "rate")
        assert rate.value.double_value == 2.5, rate
print(interrupts, flush=True)
"""


def test_a_call_after_an_interrupted_one_does_not_hang(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave"))
    done = subprocess.run(
        ["/usr/bin/python3", "-c", INTERRUPTS, "5"],
        env=daemon.environment() | {"PYTHONPATH": str(BUILD_TREE / "python")},
        capture_output=True, text=True, timeout=DEADLINE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 20
