"""Port values of a component, as a client reads them."""

import re
from collections.abc import Iterable
from typing import Any

import rtcf
from daemon_process import wait_for
from rtcf.v1 import runner_pb2


def port_value(client: rtcf.Client, component: str, port: str, runner: str = "") -> float:
    """Return the newest value of a port with one number; NaN if it has none yet."""
    (found,) = (each for each in client.get_component(component, runner).ports if each.name == port)
    return number(found.value) if found.HasField("value") else float("nan")


def parameter_values(client: rtcf.Client, component: str, runner: str = "") -> dict[str, Any]:
    """Return the values of a component's parameters."""
    return {
        each.name: getattr(each.value, str(each.value.WhichOneof("kind")))
        for each in client.get_component(component, runner).parameters
    }


def number(text: str) -> float:
    """Return the number in a value's text, e.g. "data: 2.5"."""
    match = re.fullmatch(r"data: (\S+)", text)
    assert match, f"{text!r} is not one number"
    return float(match[1])


def is_among(received: Iterable[float], wanted: Iterable[float]) -> bool:
    """Return whether the received values are a subsequence of the wanted ones."""
    rest = iter(wanted)
    return all(value in rest for value in received)


def state(client: rtcf.Client, runner: str = "rt_runner") -> runner_pb2.RunnerStatus:
    """Return the status of a runner."""
    status: runner_pb2.RunnerStatus = client.get_status(runner).runners[0]
    return status


def iteration(client: rtcf.Client, runner: str = "rt_runner") -> int:
    """Return the number of cycles of the loop."""
    return int(state(client, runner).iteration)


def wait_until_after(client: rtcf.Client, cycle: int) -> int:
    """Wait until the loop has run more than `cycle` cycles; return the number of cycles."""
    wait_for(lambda: iteration(client) > cycle, f"cycle {cycle + 1}")
    return iteration(client)
