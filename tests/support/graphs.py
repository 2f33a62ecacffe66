"""Large graphs for drawings."""

import fig_1
import rtcf
from rtcf.v1 import graph_pb2


def mimo(number: int, wires: dict[str, str], *, breaks: str = "") -> graph_pb2.ComponentSpec:
    """Return a Mimo /m000, /m001, …; ports without a connection get private names."""
    return rtcf.component(
        "rtcf_examples", "Mimo", name=f"m{number:03}",
        remaps=[f"{port}:={wires.get(port, f'~{port}')}" for port in fig_1.PORTS],
        breaks=[breaks] if breaks else [],
    )  # fmt: skip


def name(number: int) -> str:
    """Return a component's full name."""
    return f"/m{number:03}"


def chain(count: int, begin: int = 0, *, closed: bool = False) -> list[graph_pb2.ComponentSpec]:
    """Each reads its predecessor; in a closed chain the first reads the last, one cycle late."""
    end = begin + count
    specs = []
    for number in range(begin, end):
        wires = {"in1": f"/s{number - 1}", "out1": f"/s{number}"}
        if number == begin:
            wires = {"out1": f"/s{number}"}
            if closed:
                wires["in2"] = f"/s{end - 1}"
        specs.append(mimo(number, wires, breaks="in2" if closed and number == begin else ""))
    return specs


def chains(several: int, count: int) -> list[graph_pb2.ComponentSpec]:
    """Several closed chains, independent of each other."""
    return [each for at in range(several) for each in chain(count, at * count, closed=True)]


def star(count: int) -> list[graph_pb2.ComponentSpec]:
    """All read the first one, which reads the last one, one cycle late."""
    hub = mimo(0, {"out1": "/s0", "in2": f"/s{count - 1}"}, breaks="in2")
    rays = [mimo(at, {"in1": "/s0", "out1": f"/s{at}"}) for at in range(1, count)]
    return [hub, *rays]


GRAPHS = {
    "chain": chain(200),
    "closed": chain(200, closed=True),
    "star": star(200),
    "chains": chains(20, 10),
}
# Ends of the expected lines: writer and reader, and which of them are loop breaks.
LINES = {
    "chain": [(at, at + 1) for at in range(199)],
    "closed": [(at, (at + 1) % 200) for at in range(200)],
    "star": [(0, at) for at in range(1, 200)] + [(199, 0)],
    "chains": [(a * 10 + b, a * 10 + (b + 1) % 10) for a in range(20) for b in range(10)],
}


def is_break(writer: int, reader: int) -> bool:
    """Return whether a line goes back."""
    return reader < writer
