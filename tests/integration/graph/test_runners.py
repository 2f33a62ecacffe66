"""Several runners: events in one do not affect another."""

import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import rtcf
from bystander import Bystander
from daemon_process import Daemon, wait_for
from rtcf.reasons import ExecutorDownError
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2
from values import iteration

ROUNDS = 6
CHANGES = 24  # per round, approximately
CYCLES = 400  # of the bystander, per round


@dataclass(frozen=True)
class Window:
    """The counts over some cycles of the bystander."""

    cycles: int
    preempted: int  # involuntary switches of its real-time thread
    sleeps_off: int  # sleeping system calls of the thread, beyond one per cycle
    shootdowns: int  # TLB, on its CPU


def shootdowns(cpu: int) -> int:
    """Return the TLB shootdowns of a CPU so far; 0 where the machine does not count them."""
    header, *rows = Path("/proc/interrupts").read_text().splitlines()
    column = header.split().index(f"CPU{cpu}")
    for row in rows:
        name, *counts = row.split()
        if name == "TLB:":
            return int(counts[column])
    return 0


def test_starting_changing_and_crashing_one_does_not_affect_another(client: rtcf.Client) -> None:
    allowed = sorted(os.sched_getaffinity(0))
    mine, other = allowed[0], allowed[-1]
    bystander = Bystander(client, runner_pb2.RunnerSettings(frequency_hz=1000.0, cpu=mine))

    def window(work: Callable[[], None], length: int) -> Window:
        before, begin = bystander.usage(), iteration(client, bystander.runner)
        shot = shootdowns(mine)
        work()
        wait_for(lambda: iteration(client, bystander.runner) > begin + length, "its cycles")
        shot = shootdowns(mine) - shot
        after, done = bystander.usage(), iteration(client, bystander.runner) - begin
        slept = after.slept - before.slept
        return Window(done, after.preempted - before.preempted, slept - done, shot)

    quiet, busy = [], []
    for _ in range(ROUNDS):
        busy.append(window(lambda: life_of_a_runner(client, "other", other), CYCLES))
        # The same number of cycles without changes, since other processes run all the time.
        quiet.append(window(lambda: None, busy[-1].cycles))
    bystander.check()
    print("quiet:", *quiet, sep="\n  ")
    print("busy:", *busy, sep="\n  ")
    # Other processes of this machine affect the counters. Effects of the changes would occur in
    # each round, so the quietest round decides.
    assert min(each.preempted for each in busy) == 0
    # The counters of thread and loop are read at slightly different times.
    assert min(abs(each.sleeps_off) for each in busy) < CHANGES
    others = max(each.shootdowns for each in quiet)
    assert min(each.shootdowns for each in busy) < others + CHANGES


def test_loops_that_share_a_cpu_are_named_and_the_faster_one_has_the_higher_priority(
    daemon: Daemon, client: rtcf.Client
) -> None:
    cpu = min(os.sched_getaffinity(0))
    for name, frequency_hz in (("slow", 100.0), ("fast", 400.0)):
        client.add_runner(name, runner_pb2.RunnerSettings(frequency_hz=frequency_hz, cpu=cpu))
    client.start("slow")
    (slow,) = client.get_status("slow").runners
    thread = slow.realtime_tid
    before = os.sched_getparam(thread).sched_priority
    client.start("fast")
    (slow,) = client.get_status("slow").runners
    assert [each.runner for each in slow.shares_cpu_with] == ["fast"]
    (fast,) = client.get_status("fast").runners
    assert fast.settings.priority == slow.settings.priority + 4
    if not any("SCHED_FIFO" in line for line in fast.degraded):
        assert os.sched_getparam(fast.realtime_tid).sched_priority == fast.settings.priority
    for command in (("status",), ("runner", "list")):
        said = daemon.ctl(*command).stdout
        line = f"CPU {cpu} has several loops, fast (priority {fast.settings.priority}), slow"
        assert line in said
    # The first one is undisturbed.
    assert slow.realtime_tid == thread
    assert os.sched_getparam(thread).sched_priority == before
    client.stop("fast")
    assert "has several loops" not in daemon.ctl("status").stdout
    for name in ("slow", "fast"):
        client.remove_runner(name)


def life_of_a_runner(client: rtcf.Client, name: str, cpu: int) -> None:
    """Add a runner, change its running graph in every way, crash it, and remove it."""
    client.add_runner(name, runner_pb2.RunnerSettings(frequency_hz=1000.0, cpu=cpu))
    client.load(_mixer("a"), name)
    client.start(name)
    wait_for(lambda: iteration(client, name) > 0, "a cycle")
    for number in range(4):
        client.load(_mixer("b"), name)
        client.set_parameters("b", [rtcf.parse_parameter(f"offset:={number}")], name)
        client.set_breaks([control_pb2.PortName(component="b", port="in1")], True, name)
        client.replace("b", _mixer("c"), name)
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=500.0 + number), name)
        client.unload(["c"], name)
    bad = rtcf.component("rtcf_faults", "NullDereference", name="bad", parameters=["after:=5"])
    with suppress(ExecutorDownError):  # it may die before it answers
        client.load(bad, name)
    wait_for(
        lambda: client.get_status(name).runners[0].state == runner_pb2.RUNNER_STATE_FAULTED,
        "its crash and recovery",
    )
    client.remove_runner(name)


def _mixer(name: str) -> graph_pb2.ComponentSpec:
    ports = ("in1", "in2", "level", "out", "half", "updates")
    return rtcf.component(
        "rtcf_test", "Mixer", name=name, remaps=[f"{port}:=~{port}" for port in ports]
    )


def test_a_bare_stop_names_the_loops_that_keep_running(daemon: Daemon, client: rtcf.Client) -> None:
    client.add_runner("second")
    client.add_runner("third")
    for runner in ("rt_runner", "second"):
        client.load(rtcf.component("rtcf_test", "Counter"), runner)
        client.start(runner)
    done = daemon.ctl("stop")
    assert (done.returncode, done.stdout) == (0, "stopped\n")
    note = "still running: second; `rtcfctl stop --all` stops all loops"
    assert done.stderr == f"rtcfctl: note: {note}\n"
    client.start()
    # A named runner is the only one that stops.
    done = daemon.ctl("-r", "second", "stop")
    assert (done.returncode, done.stdout, done.stderr) == (0, "stopped\n", "")
    assert daemon.ctl("stop").stderr == ""


def test_cpu_claims_are_in_a_folder_that_only_their_user_can_write(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.add_runner("second")
    files: set[Path] = set()
    for runner in ("rt_runner", "second"):
        client.load(rtcf.component("rtcf_test", "Counter"), runner)
        client.start(runner)
        (status,) = client.get_status(runner).runners
        words = Path(f"/proc/{status.pid}/cmdline").read_text().split("\0")
        folder = Path(words[words.index("--cpu-claims") + 1])
        assert folder.stat().st_mode & 0o077 == 0
        held = {
            Path(os.readlink(each))
            for each in Path(f"/proc/{status.pid}/fd").iterdir()
            if os.path.islink(each) and os.readlink(each).startswith(f"{folder}/cpu-")
        }
        (file,) = held
        assert file.name.split("-")[1] == str(status.loop_cpu)
        files |= held
    assert len(files) == 2
    for runner in ("rt_runner", "second"):
        client.stop(runner)
    assert not [file for file in files if file.exists()]
