"""A loop at 2 kHz in the service of this machine, with a check that it ran without a break."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import rtcf
from machine import wait_for
from rtcf.v1 import runner_pb2
from rtcf_service import Service

FREQUENCY_HZ = 2000.0
RT_LIMIT = Path("/proc/sys/kernel/sched_rt_runtime_us")
DROP_IN = "/etc/systemd/system/rtcfd.service.d/test.conf"


@contextmanager
def limit_of_real_time(us_per_s: int) -> Iterator[None]:
    """Limit the CPU time of all real-time threads, us in a second (-1: no limit)."""
    before = RT_LIMIT.read_text()
    RT_LIMIT.write_text(str(us_per_s))
    try:
        yield
    finally:
        RT_LIMIT.write_text(before)


@dataclass(frozen=True)
class Mark:
    """Identity and cycles of a loop; only the cycles change while it runs undisturbed."""

    executor: int
    thread: int
    missed: int
    overruns: int
    iteration: int


class Loop(Service):
    """The service, queried by the client library: rtcfctl is slow on an emulated CPU."""

    def begin(self) -> None:
        """Start a loop with one component."""
        with rtcf.Client() as client:
            client.set_runner(runner_pb2.RunnerSettings(frequency_hz=FREQUENCY_HZ))
            client.load(rtcf.component("rtcf_examples", "Mimo", name="M"))
            client.start()
        wait_for(lambda: self.now().iteration > FREQUENCY_HZ, "a second of cycles")

    def told(self) -> runner_pb2.RunnerStatus:
        """Return the status of its runner."""
        with rtcf.Client() as client:
            (told,) = client.get_status("rt_runner").runners
        return told  # type: ignore[no-any-return]

    def now(self) -> Mark:
        """Return its present mark."""
        told = self.told()
        assert told.state == runner_pb2.RUNNER_STATE_RUNNING, told
        return Mark(told.pid, told.realtime_tid, told.missed, told.overruns, told.iteration)

    def must_have_gone_on(self, since: Mark, seconds: float = 0.0) -> None:
        """Fail if the loop missed a cycle or was replaced; wait for `seconds` of cycles."""
        enough = since.iteration + FREQUENCY_HZ * max(seconds, 0.5)
        now = wait_for(lambda: m if (m := self.now()).iteration > enough else None, "its cycles")
        assert now == Mark(since.executor, since.thread, since.missed, since.overruns,
                           now.iteration)  # fmt: skip

    def drop_in(self, text: str) -> None:
        """Write a drop-in of the unit and apply it; an empty text removes it."""
        file = self.machine.path(DROP_IN)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"[Service]\n{text}\n")
        if not text:
            file.unlink()
        self.systemctl("daemon-reload")
