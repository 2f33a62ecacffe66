"""Graphs of Mimo components, for rtcf.Client."""

import rtcf
from rtcf.v1 import graph_pb2

_PORTS = ("in1", "in2", "in3", "in4", "out1", "out2")


def mimo(name: str, connections: dict[str, str], first: bool = False) -> graph_pb2.ComponentSpec:
    """Return a Mimo with these connections; all other ports get private names."""
    remaps = [f"{port}:={connections.get(port, f'~{port}')}" for port in _PORTS]
    return rtcf.component("rtcf_examples", "Mimo", name=name, remaps=remaps, first=first)


def chain(length: int, first: int = 0) -> list[graph_pb2.ComponentSpec]:
    """Return components first, first+1, …, each reading from its predecessor."""
    return [
        mimo(f"C{i:04}", {"out1": f"/c{i:04}"} | ({"in1": f"/c{i - 1:04}"} if i > 0 else {}))
        for i in range(first, first + length)
    ]


def paper() -> list[graph_pb2.ComponentSpec]:
    """Return Fig. 1 of the paper."""
    return [
        mimo(
            "H1",
            {"in1": "/R3_G2H1", "in2": "/R1_H1R2", "out1": "/H1_F1", "out2": "/H1_R1R2"},
            first=True,
        ),
        mimo("F1", {"in1": "/H1_F1", "out1": "/F1_R2R3"}),
        mimo("R1", {"in1": "/H1_R1R2", "out1": "/R1_H1R2"}),
        mimo(
            "R2",
            {
                "in1": "/F1_R2R3",
                "in2": "/H1_R1R2",
                "in3": "/R1_H1R2",
                "in4": "/G2_R2",
                "out1": "/R2_R3",
            },
        ),
        mimo("R3", {"in1": "/F1_R2R3", "in2": "/R2_R3", "out1": "/R3_G2H1"}),
    ]
