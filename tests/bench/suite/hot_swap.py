"""Changes of a running graph at 2 kHz and their cost in the loop."""

import time
from pathlib import Path

import rtcf
from graphs import paper
from result import Budget, Result
from rtcf.v1 import control_pb2, runner_pb2
from setting import FREQUENCY_HZ, Setting

from daemon import Daemon

_CHANGES = 1000
_WARM_UP = 52  # like _CHANGES, a multiple of 4, which restores the graph


def run(setting: Setting) -> Result:
    """Load, rewire and unload 1000 times; report cycles, page faults and memory."""
    result = Result(
        "hot_swap", f"{_CHANGES} changes of Fig. 1 running at {FREQUENCY_HZ} Hz", ["", "value"]
    )
    with Daemon(setting) as daemon:
        client = daemon.client
        client.set_runner(settings=runner_pb2.RunnerSettings(frequency_hz=FREQUENCY_HZ))
        for component in paper():
            client.load(component)
        client.start()
        _change(client, _WARM_UP)
        client.reset_statistics()
        faults = _page_faults(daemon)
        memory = _resident_kb(daemon)
        begin = time.monotonic()
        _change(client, _CHANGES)
        elapsed = time.monotonic() - begin
        found = client.get_statistics()
        faults = _page_faults(daemon) - faults
        memory = _resident_kb(daemon) - memory
        client.stop()
    period_ns = 1e9 / FREQUENCY_HZ
    # If the calculation is short, the machine's other load caused the missed cycle.
    own = found.missed if found.duration.max_ns > period_ns else 0
    result.rows = [
        ["changes per second", _CHANGES / elapsed],
        ["cycles", found.iterations],
        ["cycles missed", found.missed],
        ["longest calculation, µs", found.duration.max_ns / 1e3],
        ["page faults of the real-time thread", faults],
        ["growth of the executor, kB", memory],
    ]
    result.budgets = [
        Budget("missed, with a calculation longer than the period", own, 0, "cycles"),
        Budget("page faults of the real-time thread", faults, 0, ""),
        Budget("growth of the executor", memory, 0, "kB"),
    ]
    return result


def _change(client: rtcf.Client, count: int) -> None:
    port = [control_pb2.PortName(component="/R2", port="in3")]
    for i in range(count):
        match i % 4:
            case 0:
                client.load(rtcf.component("rtcf_examples", "Mimo", name="X", ns="/x"))
            case 1:
                client.set_breaks(port, broken=True)
            case 2:
                client.unload(["/x/X"])
            case _:
                client.set_breaks(port, broken=False)


def _page_faults(daemon: Daemon) -> int:
    """Return the minor and major faults of the real-time thread: proc(5), stat, 10 and 12."""
    thread = daemon.client.get_status().runners[0].realtime_tid
    text = Path(f"/proc/{daemon.executor}/task/{thread}/stat").read_text()
    fields = text[text.rindex(")") + 2 :].split()
    return int(fields[7]) + int(fields[9])


def _resident_kb(daemon: Daemon) -> int:
    lines = Path(f"/proc/{daemon.executor}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:"))
