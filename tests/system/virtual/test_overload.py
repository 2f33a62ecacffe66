"""A loop that is overloaded for good, without the kernel's limit of real-time threads.

On one CPU, nothing but the loop itself leaves time to others.
"""

import os
import subprocess
import sys

import rtcf
from loop_2khz import FREQUENCY_HZ, Loop, limit_of_real_time
from machine import wait_for
from rtcf.v1 import graph_pb2, runner_pb2

PATIENCE_S = 600  # emulated CPUs are slow
MEASURED_S = 20.0
# Uses a CPU for a time, and prints its share of it. Arguments: time (s), CPU.
HOG = """
import os, sys, time
seconds = float(sys.argv[1])
os.sched_setaffinity(0, {int(sys.argv[2])})
begin = time.monotonic()
while time.monotonic() < begin + seconds:
    pass
print(time.process_time() / (time.monotonic() - begin))
"""


def share_of(cpu: int) -> float:
    """Return the share of a CPU that an ordinary process has."""
    hog = [sys.executable, "-I", "-S", "-c", HOG, str(MEASURED_S), str(cpu)]
    done = subprocess.run(hog, stdout=subprocess.PIPE, text=True, check=True, timeout=PATIENCE_S)
    return float(done.stdout)


def test_an_overloaded_loop_leaves_a_quarter_of_its_cpu_and_can_be_relieved(loop: Loop) -> None:
    cpu = loop.told().loop_cpu
    before = loop.now()
    with limit_of_real_time(-1), rtcf.Client() as client:
        # 150 ms in a cycle of 0.5 ms.
        client.load(rtcf.component("rtcf_faults", "Lingers", name="lingers"))
        wait_for(
            lambda: loop.said("the loop is overloaded"), "the report of the overload", PATIENCE_S
        )
        share = share_of(cpu)
        print(f"share of CPU {cpu} of {os.cpu_count()}: {share:.2f}")
        assert share > 0.2
        # Changes of every kind, while it is overloaded.
        client.load(rtcf.component("rtcf_examples", "Identity", name="late", remaps=["out:=~out"]))
        client.set_breaks([rtcf.parse_port("late.in")], True)
        assert client.get_component("late").state == graph_pb2.COMPONENT_STATE_RUNNING
        assert loop.told().state == runner_pb2.RUNNER_STATE_RUNNING
        client.stop()
        client.start()
        wait_for(lambda: loop.now().missed > before.missed, "missed cycles", PATIENCE_S)
        client.unload(["lingers"])
        relieved = loop.now()
        enough = relieved.iteration + FREQUENCY_HZ
        wait_for(lambda: loop.now().iteration > enough, "a second of cycles", PATIENCE_S)
        assert share_of(cpu) > share + 0.2
        assert loop.now().executor == before.executor
