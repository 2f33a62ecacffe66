"""The values of the last second outlive the executor after any cause of death."""

import os
import random
import signal
import time
from collections.abc import Iterator

import numpy as np
import pytest
import rtcf
from daemon_process import NO_ROS, Daemon, is_gone, wait_for
from rtcf.v1 import runner_pb2
from rtcf_shared.ports import PortBatch, schema_of
from rtcfd.incidents import frame_file
from shared_memory import SharedMemory
from values import state

SETTINGS = f"[runner]\nfrequency_hz = 1000\n{NO_ROS}"
LONGEST_WAIT_S = 0.3
AT_MOST_BEFORE = 2  # cycles


@pytest.fixture
def settings() -> str:
    """Return the settings of a loop of 1 kHz."""
    return SETTINGS


@pytest.fixture
def counting(daemon: Daemon, client: rtcf.Client) -> Iterator[rtcf.Client]:
    """Yield a client of a loop that counts its cycles."""
    client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
    yield client


def die(client: rtcf.Client) -> SharedMemory:
    """Run the loop for a random time, and kill its executor."""
    client.start()
    wait_for(lambda: state(client).iteration > 20, "20 cycles")
    pid = state(client).pid
    memory = SharedMemory(pid)
    time.sleep(random.uniform(0.0, LONGEST_WAIT_S))
    os.kill(pid, signal.SIGKILL)
    wait_for(lambda: is_gone(pid), "the end of the executor")
    return memory


def check_frames(memory: SharedMemory) -> None:
    ring = frame_file.read(memory.frames)[-1]
    cycles = ring.cycles
    assert len(cycles) > 10
    assert (np.diff(cycles) == 1).all(), "no cycle is missing"
    assert memory.recorder.read().iteration - cycles[-1] <= AT_MOST_BEFORE
    assert (ring.stamps_ns[1:] > ring.stamps_ns[:-1]).all()
    (message,) = ring.batches()
    batch = PortBatch(schema_of(ring.schema()), 1, message.first_cycle, 0, False, message)
    values = batch["/steady.out"]
    assert (np.diff(values) == 1).all(), "each value is of its own cycle"


def kill_at_random(client: rtcf.Client, times: int) -> None:
    for _ in range(times):
        memory = die(client)
        try:
            check_frames(memory)
        finally:
            memory.close()
        # After several crashes within a minute rtcfd starts no executor by itself.
        client.restart_runner("rt_runner")
        assert state(client).state != runner_pb2.RUNNER_STATE_DOWN


def test_the_last_cycles_are_there_after_sigkill(counting: rtcf.Client) -> None:
    kill_at_random(counting, 3)


@pytest.mark.long
def test_the_last_cycles_are_there_after_sigkill_at_100_instants(counting: rtcf.Client) -> None:
    kill_at_random(counting, 100)


def test_the_cycles_before_a_change_are_kept_too(daemon: Daemon, counting: rtcf.Client) -> None:
    counting.start()
    wait_for(lambda: state(counting).iteration > 50, "50 cycles")
    counting.load(rtcf.component("rtcf_test", "Counter", name="other"))
    then = state(counting).iteration
    wait_for(lambda: state(counting).iteration > then + 50, "50 more cycles")
    memory = SharedMemory(state(counting).pid)
    try:
        before, after = frame_file.read(memory.frames)[-2:]
    finally:
        memory.close()
    assert {value.component for value in before.layout.values} == {"/steady"}
    assert {value.component for value in after.layout.values} == {"/steady", "/other"}
    assert before.cycles[-1] + 1 == after.cycles[0], "no cycle is missing between the rings"


def test_values_that_do_not_fit_a_frame_are_reported(daemon: Daemon, client: rtcf.Client) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frame_kb=0))
    client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
    memory = SharedMemory(state(client).pid)
    try:
        assert all(not ring.layout.values for ring in frame_file.read(memory.frames))
        with client.watch_ports() as stream:
            client.start()
            batch = next(batch for batch in stream if len(batch))
        assert (np.diff(batch["/steady.out"]) == 1).all()
    finally:
        memory.close()


def test_a_frame_size_out_of_range_is_rejected(daemon: Daemon) -> None:
    refused = daemon.ctl("runner", "set", "rt_runner", "--frame-kb", "1025")
    assert refused.returncode != 0
    assert "1025" in refused.stderr and "1024" in refused.stderr
