"""Duration of control calls, loads and whole graphs; memory of rtcfd and executor."""

import functools
import time
from pathlib import Path

import rtcf
from cost import Cost, busy_with_others, cost_of, median_cost
from graphs import chain, paper
from processes import output_of
from result import Budget, Result
from rtcf.v1 import graph_pb2, runner_pb2
from setting import FREQUENCY_HZ, Setting

from daemon import Daemon

_CALLS = 11
_LONG_CHAIN = 200
_GRAPH = 1000
_ROUNDS = 3
_MB = 1024.0  # kB
_REFERENCE = ("/usr/bin/python3", "-I", "-c", "import grpc")


def run(setting: Setting) -> Result:
    """Measure with a loop running at 2 kHz, then with a stopped one."""
    result = Result("control", "control: medians", ["action", "ms", "ms of CPU"])
    with Daemon(setting) as daemon:
        client = daemon.client
        client.set_runner(settings=runner_pb2.RunnerSettings(frequency_hz=FREQUENCY_HZ))
        for component in paper():
            client.load(component)
        cold_calls, references = [], []
        for _ in range(_CALLS):
            cold_calls.append(_calls(daemon, "status"))
            references.append(cost_of(lambda: output_of(_REFERENCE), daemon.servers))
        cold = median_cost(cold_calls)
        client.start()
        by_rtcfctl = median_cost(_load_by_rtcfctl(daemon, i) for i in range(_CALLS))
        by_client = median_cost(_load_by_client(daemon, i) for i in range(_CALLS))
        client.stop()
        client.apply([], "rt_runner")
        every = functools.partial(_load_all, client, chain(_LONG_CHAIN))
        long_chain = cost_of(every, daemon.servers)
        graphs = []
        for _ in range(_ROUNDS):
            client.apply([], "rt_runner")
            graphs.append(cost_of(lambda: client.apply(chain(_GRAPH), "rt_runner"), daemon.servers))
        graph = median_cost(graphs)
        further = [functools.partial(client.load, chain(1, _GRAPH + i)[0]) for i in range(_CALLS)]
        client.start()
        one_more = median_cost(cost_of(load, daemon.servers) for load in further)
        client.stop()
    result.rows = [
        [what, cost.clock, cost.cpu]
        for what, cost in (
            ("rtcfctl status, cold", cold),
            ("alternating with it: Python importing gRPC", median_cost(references)),
            (f"load one component into Fig. 1 at {FREQUENCY_HZ} Hz, rtcfctl", by_rtcfctl),
            (f"load one component into Fig. 1 at {FREQUENCY_HZ} Hz, Python client", by_client),
            (f"load {_LONG_CHAIN} components one by one, Python client", long_chain),
            (f"apply a graph of {_GRAPH}", graph),
            (f"load one more into the running graph of {_GRAPH}", one_more),
        )
    ]
    result.budgets = [
        Budget("rtcfctl call, cold", cold.clock, 250.0, "ms"),
        Budget(f"apply of a graph of {_GRAPH}", graph.clock / 1e3, 2.0, "s"),
        Budget("one more component into it", one_more.clock, 20.0, "ms"),
    ]
    result.notes.append(
        f"load: in {busy_with_others():.0%} of the last minute tasks waited for a CPU; most of the "
        "elapsed time above the CPU time is such waits"
    )
    return result


def run_memory(setting: Setting) -> Result:
    """Measure the memory of rtcfd and of an executor with ROS node while Fig. 1 runs."""
    result = Result("memory", "memory, Fig. 1 running, with ROS", ["process", "measure", "MB"])
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
        # Locked pages are resident; VmLck also counts reserved addresses.
        Budget("executor with ROS", resident, 64.0, "MB locked"),
    ]
    return result


def _calls(daemon: Daemon, *arguments: str) -> Cost:
    return cost_of(lambda: daemon.call(*arguments), daemon.servers)


def _load_by_rtcfctl(daemon: Daemon, index: int) -> Cost:
    place = ("--name", f"T{index}", "--ns", f"/t{index}")
    return _calls(daemon, "load", "rtcf_examples", "Mimo", *place)


def _load_by_client(daemon: Daemon, index: int) -> Cost:
    component = rtcf.component("rtcf_examples", "Mimo", name=f"U{index}", ns=f"/u{index}")
    return cost_of(lambda: daemon.client.load(component), daemon.servers)


def _load_all(client: rtcf.Client, components: list[graph_pb2.ComponentSpec]) -> None:
    for component in components:
        client.load(component)


def _field(pid: int, file: str, name: str) -> float:
    for line in Path(f"/proc/{pid}/{file}").read_text().splitlines():
        if line.startswith(name):
            return float(line.split()[1])
    return 0.0
