"""Fig. 1 of the paper: its connections, and its values, computed independently of the loop."""

from collections.abc import Iterable, Iterator

import rtcf
from rtcf.v1 import graph_pb2

ORDER = ["/H1", "/F1", "/R1", "/R2", "/R3"]
WHITELIST = ".*R3_G2H1|.*R1_H1R2|.*G2_R2"
PORTS = ("in1", "in2", "in3", "in4", "out1", "out2")

# Ports and their connections.
WIRES: dict[str, dict[str, str]] = {
    "H1": {"in1": "/R3_G2H1", "in2": "/R1_H1R2", "out1": "/H1_F1", "out2": "/H1_R1R2"},
    "F1": {"in1": "/H1_F1", "out1": "/F1_R2R3"},
    "R1": {"in1": "/H1_R1R2", "out1": "/R1_H1R2"},
    "R2": {"in1": "/F1_R2R3", "in2": "/H1_R1R2", "in3": "/R1_H1R2", "in4": "/G2_R2",
           "out1": "/R2_R3"},
    "R3": {"in1": "/F1_R2R3", "in2": "/R2_R3", "out1": "/R3_G2H1"},
}  # fmt: skip


def mimo(name: str, wires: dict[str, str], *, first: bool = False) -> graph_pb2.ComponentSpec:
    """Return a Mimo; ports without a connection get private names."""
    remaps = [f"{port}:={wires.get(port, f'~{port}')}" for port in PORTS]
    return rtcf.component("rtcf_examples", "Mimo", name=name, remaps=remaps, first=first)


def load(client: rtcf.Client, names: Iterable[str] = ("H1", "F1", "R1", "R2", "R3")) -> None:
    """Load the components in the order given."""
    for name in names:
        client.load(mimo(name, WIRES[name], first=name == "H1"))


def mimo_sum(
    in1: float | None, in2: float | None, in3: float | None = None, in4: float | None = None
) -> float:
    """Return the value that a Mimo writes; None is an input without new data."""
    total = 1.0 if in1 is None else in1
    for value in (in2, in3, in4):
        total += 0.0 if value is None else value
    return 1.0 if total > 1e20 else total


def simulate() -> Iterator[dict[str, float]]:
    """Yield the values that the components write in each cycle, without a new value of G2."""
    r1: float | None = None
    r3: float | None = None
    while True:
        h1 = mimo_sum(r3, r1)  # of the previous cycle
        f1 = mimo_sum(h1, None)
        r1 = mimo_sum(h1, None)
        r2 = mimo_sum(f1, h1, r1)
        r3 = mimo_sum(f1, r2)
        yield {"H1": h1, "F1": f1, "R1": r1, "R2": r2, "R3": r3}
