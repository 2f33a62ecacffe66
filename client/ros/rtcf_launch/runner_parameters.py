"""The private parameters of rt_runner, and the runner settings made from them."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import rtcf
from rtcf.v1 import graph_pb2, runner_pb2
from rtcf_shared import whole_files
from rtcf_shared.enums import choices
from rtcf_shared.quantities import ROS, RUNNER, Quantity

from rtcf_launch.codes import Code, Ending
from rtcf_launch.parameters import Parameters, as_integer, close_to
from rtcf_launch.runner_entry import NAME as RUNNER_ENTRY

MODES = ("wait_for_components", "no_wait", "wait_for_trigger")
DAEMONS = ("auto", "system", "private")
# The paper's names of overrun policies.
_WAIT_POLICIES = {
    "absolute": runner_pb2.OVERRUN_POLICY_CATCH_UP,
    "relative": runner_pb2.OVERRUN_POLICY_RELATIVE,
}
_OVERRUNS = choices(runner_pb2.OverrunPolicy.DESCRIPTOR)
_REALTIME = choices(runner_pb2.Realtime.DESCRIPTOR)
_ON_CRASH = choices(runner_pb2.OnCrash.DESCRIPTOR)
_SIM_TIME = choices(runner_pb2.SimTime.DESCRIPTOR)
_PEERS = choices(runner_pb2.Right.DESCRIPTOR)
_LARGEST = 2**31 - 1  # XML-RPC has no larger integers

_NAMES = (
    *("frequency", "graph", "mode", "num_components_expected", "ros_mapping_whitelist"),
    *("ros_mapping_blacklist", "ros_queue", "wait_policy", "overrun", "max_overruns"),
    *("lock_memory", "safe_heap_size_kB", "safe_stack_size_kB", "cpu_affinity_mask", "cpu"),
    *("priority", "spin", "realtime", "stall_timeout", "hook_timeout"),
    *("warmup_cycles", "on_crash"),
    *("daemon", "on_fault", "ros_latch", "ros_decimation", "ros_decimate"),
    *("ros_stamped", "ros_largest_message_kB", "ros_peers", "sim_time", "max_clock_jump"),
)


@dataclass
class RunnerParameters:
    """The values of rt_runner's private parameters."""

    settings: runner_pb2.RunnerSettings
    mode: str
    components: int  # expected, in the mode wait_for_components
    graph: list[graph_pb2.ComponentSpec]  # of the file ~graph
    daemon: str
    exit_on_fault: bool


def read(values: dict[str, Any]) -> tuple[RunnerParameters, list[str]]:
    """Check all parameters; return their values, and a warning for each unknown parameter."""
    given = Parameters(values)
    settings = runner_pb2.RunnerSettings()

    def put(field: str, value: Any, message: Any = settings) -> None:
        if value is not None:
            setattr(message, field, value)

    put("frequency_hz", given.number("frequency", *_range("frequency_hz")))
    put("priority", given.integer("priority", *_whole("priority")))
    put("lock_memory", given.boolean("lock_memory"))
    put("heap_kb", given.integer("safe_heap_size_kB", *_whole("heap_kb")))
    # RTCF 2021's default of 0 means none; a thread has `least` in any case.
    least, most = _whole("stack_kb")
    stack = given.integer("safe_stack_size_kB", 0, most)
    put("stack_kb", None if stack is None else max(stack, least))
    put("max_overruns", given.integer("max_overruns", *_whole("max_overruns")))
    put("warmup_cycles", given.integer("warmup_cycles", *_whole("warmup_cycles")))
    stall_s = given.number("stall_timeout", *(ms / 1000 for ms in _range("stall_timeout_ms")))
    put("stall_timeout_ms", None if stall_s is None else round(stall_s * 1000))
    put("hook_timeout_s", given.number("hook_timeout", *_range("hook_timeout_s")))
    put("realtime", _value(_REALTIME, given.word("realtime", _REALTIME)))
    put("on_crash", _value(_ON_CRASH, given.word("on_crash", _ON_CRASH)))
    put("overrun", _overrun(given))
    put("cpu", _cpu(given))
    _spin(given, settings)
    put("whitelist", given.text("ros_mapping_whitelist"), settings.ros)
    put("blacklist", given.text("ros_mapping_blacklist"), settings.ros)
    put("queue", given.integer("ros_queue", *_whole("queue", ROS)), settings.ros)
    put("latch", given.text("ros_latch"), settings.ros)
    put("decimation", given.integer("ros_decimation", *_whole("decimation", ROS)), settings.ros)
    put("decimate", given.text("ros_decimate"), settings.ros)
    put("stamped", given.text("ros_stamped"), settings.ros)
    largest = given.integer("ros_largest_message_kB", *_whole("largest_message_kb", ROS))
    put("largest_message_kb", largest, settings.ros)
    put("peers", _value(_PEERS, given.word("ros_peers", _PEERS)), settings.ros)
    put("sim_time", _value(_SIM_TIME, given.word("sim_time", _SIM_TIME)))
    put("max_clock_jump_s", given.number("max_clock_jump", *_range("max_clock_jump_s")))

    graph = _graph(given, settings)
    components = given.integer("num_components_expected", 1, _LARGEST)
    if components is None and graph:
        components = len(graph)
    mode = given.word("mode", MODES) or ("no_wait" if components is None else MODES[0])
    if mode == MODES[0] and components is None:
        raise Ending(
            Code.USAGE,
            "~mode is wait_for_components: set ~num_components_expected",
        )
    result = RunnerParameters(
        settings=settings,
        mode=mode,
        components=components or 0,
        graph=graph,
        daemon=given.word("daemon", DAEMONS) or DAEMONS[0],
        exit_on_fault=(given.word("on_fault", ("exit", "stay")) or "exit") == "exit",
    )
    # An unknown name may be a typing error, or belong to another program.
    unknown = sorted(name for name in given.rest() if name != RUNNER_ENTRY)
    return result, [
        f"rt_runner has no parameter ~{name}{close_to(name, _NAMES)}" for name in unknown
    ]


def _graph(given: Parameters, settings: runner_pb2.RunnerSettings) -> list[graph_pb2.ComponentSpec]:
    """Return the components of the file ~graph; add its settings, below the parameters."""
    file = given.text("graph")
    if file is None:
        return []
    try:
        graphs = rtcf.read_graphs(whole_files.read(file).decode(), file)
    except OSError as error:
        raise Ending(Code.USAGE, f"~graph {file}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise Ending(Code.USAGE, f"~graph {file}: not UTF-8 text") from None
    except rtcf.RtcfError as error:
        raise Ending(Code.USAGE, f"~graph {error}") from None
    if len(graphs) != 1:
        raise Ending(Code.USAGE, f"~graph {file} has {len(graphs)} runners: it must have one")
    (graph,) = graphs
    graph.settings.MergeFrom(settings)
    settings.CopyFrom(graph.settings)
    return graph.components


def _range(field: str) -> tuple[float, float]:
    return RUNNER[field].low, RUNNER[field].high


def _whole(field: str, table: Mapping[str, Quantity] = RUNNER) -> tuple[int, int]:
    return int(table[field].low), int(table[field].high)


def _overrun(given: Parameters) -> int | None:
    overrun = given.word("overrun", _OVERRUNS)
    policy = given.word("wait_policy", _WAIT_POLICIES)
    if overrun is not None and policy is not None:
        raise Ending(Code.USAGE, "~wait_policy and ~overrun both set the overrun policy: use one")
    return _value(_OVERRUNS, overrun) or _value(_WAIT_POLICIES, policy)


def _cpu(given: Parameters) -> int | None:
    """Return the CPU of the loop; with a mask, its last permitted CPU."""
    cpu = given.integer("cpu", -1, 4095)
    mask = as_integer(given.raw("cpu_affinity_mask"))
    if mask is None:
        return cpu
    if cpu is not None:
        raise Ending(Code.USAGE, "~cpu and ~cpu_affinity_mask both set the CPU: use one")
    if isinstance(mask, bool) or not isinstance(mask, int) or mask < 1:
        raise Ending(
            Code.USAGE, f"~cpu_affinity_mask must be an integer with a bit for each CPU, not {mask}"
        )
    allowed = [each for each in os.sched_getaffinity(0) if mask >> each & 1]
    if not allowed:
        raise Ending(
            Code.USAGE,
            f"~cpu_affinity_mask {mask:#x} has none of the CPUs that may be used: "
            f"{', '.join(str(each) for each in sorted(os.sched_getaffinity(0)))}",
        )
    return max(allowed)


def _spin(given: Parameters, settings: runner_pb2.RunnerSettings) -> None:
    spin = as_integer(given.raw("spin"))
    if spin is None:
        return
    if spin == "auto":
        settings.spin_auto = True
    elif isinstance(spin, int) and not isinstance(spin, bool) and RUNNER["spin_us"].holds(spin):
        settings.spin_us = spin
    else:
        raise Ending(Code.USAGE, f'~spin must be a number of µs or "auto", not {spin}')


def _value(words: Mapping[str, Any], word: str | None) -> int | None:
    return None if word is None else int(words[word])
