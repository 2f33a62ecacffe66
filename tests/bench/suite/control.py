"""How long control takes: calls, loading, whole graphs; and the memory it all takes."""

import functools
import time
from collections.abc import Callable
from pathlib import Path

import rtcf
from figures import median
from graphs import chain, paper
from result import Budget, Result
from rtcf.v1 import runner_pb2
from setting import FREQUENCY_HZ, Setting

from daemon import Daemon

_CALLS = 11
_LONG_CHAIN = 200
_GRAPH = 1000
_MB = 1024.0  # kB


def run(setting: Setting) -> Result:
    """Measure against a loop that runs at 2 kHz, then against one that stands still."""
    result = Result("control", "control: medians", ["what", "ms"])
    with Daemon(setting) as daemon:
        client = daemon.client
        client.set_runner(settings=runner_pb2.RunnerSettings(frequency_hz=FREQUENCY_HZ))
        for component in paper():
            client.load(component)
        client.start()
        cold = median(daemon.call("status") for _ in range(_CALLS))
        loaded = median(_load_by_rtcfctl(daemon, i) for i in range(_CALLS))
        by_client = median(_load_by_client(client, i) for i in range(_CALLS))
        client.stop()
        client.apply([])
        long_chain = _timed(lambda: [client.load(component) for component in chain(_LONG_CHAIN)])
        client.apply([])
        graph = _timed(lambda: client.apply(chain(_GRAPH)))
        further = [functools.partial(client.load, chain(1, _GRAPH + i)[0]) for i in range(5)]
        one_more = median(_timed(load) for load in further)
    result.rows = [
        ["rtcfctl status, cold", cold * 1e3],
        ["load one component into Fig. 1 at 2 kHz, rtcfctl", loaded * 1e3],
        ["load one component into Fig. 1 at 2 kHz, Python client", by_client * 1e3],
        [f"load {_LONG_CHAIN} components one by one, Python client", long_chain * 1e3],
        [f"apply a graph of {_GRAPH}", graph * 1e3],
        [f"load one more into the graph of {_GRAPH}", one_more * 1e3],
    ]
    result.budgets = [
        Budget("rtcfctl call, cold", cold * 1e3, 250.0, "ms"),
        Budget(f"apply of a graph of {_GRAPH}", graph, 2.0, "s"),
        Budget("one more component into it", one_more * 1e3, 20.0, "ms"),
    ]
    return result


def run_memory(setting: Setting) -> Result:
    """Measure what rtcfd and an executor with its ROS node take, with Fig. 1 running."""
    result = Result("memory", "memory, Fig. 1 running, with ROS", ["process", "what", "MB"])
    with Daemon(setting, ros=True) as daemon:
        for component in paper():
            daemon.client.load(component)
        daemon.client.start()
        time.sleep(1)
        rtcfd = _field(daemon.process.pid, "smaps_rollup", "Pss:") / _MB
        resident = _field(daemon.executor, "status", "VmRSS:") / _MB
        locked = _field(daemon.executor, "status", "VmLck:") / _MB
        daemon.client.stop()
    result.rows = [
        ["rtcfd", "PSS", rtcfd],
        ["rtcf-executor", "RSS", resident],
        ["rtcf-executor", "VmLck (address space)", locked],
    ]
    result.budgets = [
        Budget("rtcfd", rtcfd, 80.0, "MB"),
        # Locked pages are resident; VmLck counts reserved addresses besides.
        Budget("executor with ROS", resident, 64.0, "MB locked"),
    ]
    return result


def _timed(action: Callable[[], object]) -> float:
    begin = time.monotonic()
    action()
    return time.monotonic() - begin


def _load_by_rtcfctl(daemon: Daemon, index: int) -> float:
    name = f"T{index}"
    return daemon.call("load", "rtcf_examples", "Mimo", "--name", name, "--ns", f"/t{index}")


def _load_by_client(client: rtcf.Client, index: int) -> float:
    component = rtcf.component("rtcf_examples", "Mimo", name=f"U{index}", ns=f"/u{index}")
    return _timed(lambda: client.load(component))


def _field(pid: int, file: str, name: str) -> float:
    for line in Path(f"/proc/{pid}/{file}").read_text().splitlines():
        if line.startswith(name):
            return float(line.split()[1])
    return 0.0
