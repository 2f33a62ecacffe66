"""What a client sees at the ports of a component."""

import re

import rtcf


def port_value(client: rtcf.Client, component: str, port: str) -> float:
    """Return the newest value of a port that carries one number; NaN if it never had one."""
    (found,) = (each for each in client.get_component(component).ports if each.name == port)
    return number(found.value) if found.HasField("value") else float("nan")


def number(text: str) -> float:
    """Return the number in a value's text, e.g. "data: 2.5"."""
    match = re.fullmatch(r"data: (\S+)", text)
    assert match, f"{text!r} is not one number"
    return float(match[1])


def iteration(client: rtcf.Client, runner: str = "rt_runner") -> int:
    """Return how many cycles the loop has run."""
    return int(client.get_status(runner).runners[0].iteration)
