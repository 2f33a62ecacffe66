"""Loops without real-time rights or under limits: rejected or degraded, naming the missing
right."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
import rtcf
from daemon_process import NO_ROS, Daemon, wait_for
from rtcf.v1 import runner_pb2
from values import iteration


@dataclass(frozen=True)
class Lack:
    """A right that is withdrawn, and the resulting messages."""

    limit: str  # option of prlimit(1): the limit for users without the capability
    capability: str  # root's way to the right
    problem: str
    remedies: list[str]
    settings: str = ""

    def wrapper(self) -> list[str]:
        """Return a command that runs another without the right."""
        limited = ["prlimit", self.limit]
        if os.geteuid() != 0:
            return limited
        # Programs run by root lack capabilities that are not in the bounding set.
        without = f"-{self.capability}"
        return [*limited, "setpriv", "--inh-caps", without, "--bounding-set", without]


NO_FIFO = Lack(
    "--rtprio=0:0", "sys_nice", "no SCHED_FIFO priority 80", ["CAP_SYS_NICE", "LimitRTPRIO"],
    "lock_memory = false\n",
)  # fmt: skip
LACKS = {
    "no SCHED_FIFO": NO_FIFO,
    "no memory lock": Lack(
        "--memlock=65536:65536", "ipc_lock", "memory is not locked",
        ["CAP_IPC_LOCK", "LimitMEMLOCK"],
    ),
}  # fmt: skip


@contextmanager
def running(folder: Path, lack: Lack, realtime: str) -> Iterator[Daemon]:
    settings = f'[daemon]\nrealtime = "{realtime}"\n[runner]\n{lack.settings}{NO_ROS}'
    daemon = Daemon(folder, settings, wrapper=lack.wrapper())
    daemon.start()
    try:
        yield daemon
    finally:
        daemon.end()


@pytest.mark.parametrize("lack", LACKS.values(), ids=LACKS)
def test_required_real_time_fails_and_names_the_missing_right(tmp_path: Path, lack: Lack) -> None:
    with running(tmp_path, lack, "required") as daemon:
        done = daemon.ctl("load", "rtcf_test", "Witness")
        assert done.returncode == 0, done.stderr
        refused = daemon.ctl("start")
        assert (refused.returncode, refused.stdout) == (1, "")
        assert re.fullmatch(r"rtcfctl: [^\n]+\n", refused.stderr)
        for word in (lack.problem, *lack.remedies, "--realtime preferred"):
            assert word in refused.stderr
        with rtcf.Client(daemon.socket) as client:
            status = client.get_status("rt_runner").runners[0]
            assert (status.state, status.iteration) == (runner_pb2.RUNNER_STATE_STOPPED, 0)
        # Components that had started are stopped again, and the advice works.
        wait_for(lambda: "hook stop" in daemon.log(), "the stop hook")
        assert daemon.ctl("runner", "set", "--realtime", "preferred").returncode == 0
        started = daemon.ctl("start")
        assert (started.returncode, started.stdout) == (0, "started\n")
        loud, *reasons = started.stderr.splitlines()
        assert loud == "!! rt_runner IS NOT REAL TIME:"
        assert any(each.startswith(f"!!   {lack.problem}") for each in reasons)


@pytest.mark.parametrize("lack", LACKS.values(), ids=LACKS)
def test_preferred_real_time_runs_degraded_with_a_warning(tmp_path: Path, lack: Lack) -> None:
    with running(tmp_path, lack, "preferred") as daemon, rtcf.Client(daemon.socket) as client:
        assert daemon.ctl("load", "rtcf_test", "Counter").returncode == 0
        assert any(lack.problem in each for each in client.start().degraded)
        wait_for(lambda: iteration(client) > 100, "100 cycles")
        (line,) = (
            each
            for each in client.get_status("rt_runner").runners[0].degraded
            if lack.problem in each
        )
        for word in lack.remedies:
            assert word in line
        assert lack.problem in daemon.ctl("status").stdout
        said = f" ERROR   rt_runner: degraded real time: {lack.problem}"
        wait_for(lambda: said in daemon.log(), "the log")


def test_a_full_bucket_does_not_stop_a_loop_that_runs_degraded(tmp_path: Path) -> None:
    with running(tmp_path, NO_FIFO, "preferred") as daemon, rtcf.Client(daemon.socket) as client:
        # 100 µs in each cycle of 50 µs, so every cycle is late.
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=20000.0, max_overruns=5))
        client.load(rtcf.component("rtcf_faults", "Sleeps", parameters=["after:=0"]))
        client.start()
        wait_for(lambda: client.get_statistics().overruns > 50, "overruns")
        status = client.get_status("rt_runner").runners[0]
        assert status.state == runner_pb2.RUNNER_STATE_RUNNING
        for said in ("ended late", "max_overruns does not stop a degraded loop"):
            wait_for(lambda: said in daemon.log(), said)  # noqa: B023
        client.stop()
        wait_for(lambda: "most of them in /Sleeps" in daemon.log(), "the last line")
        lines = [line for line in daemon.log().splitlines() if "ended late" in line]
        assert len(lines) < 10, "one line for many overruns"
        assert any("most of them in /Sleeps" in line for line in lines)


def test_a_constantly_late_loop_is_alarmed_with_its_cause(tmp_path: Path) -> None:
    with running(tmp_path, NO_FIFO, "preferred") as daemon, rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=20000.0))
        client.load(rtcf.component("rtcf_faults", "Sleeps", parameters=["after:=0"]))
        client.start()

        # Repeated every 10 s; the second message shows that it continues. A busy machine may be
        # the cause once, but not each time.
        def late() -> str:
            said = daemon.ctl("status").stdout.splitlines()
            late = (each for each in said if "IS LATE" in each)
            return next((each for each in late if "most of them in /Sleeps" in each), "")

        line = wait_for(late, "the alarm")
        assert line.startswith("!! rt_runner IS LATE: ")
