"""Fig. 1 of the paper: five components, their connections, and their load requests.

A connection is a name that an output and its inputs share.  An unconnected port
gets a private name (~port), so that no other port has the same name.
"""

import rtcf
from rtcf.v1 import graph_pb2

PORTS = ("in1", "in2", "in3", "in4", "out1", "out2")

WIRES: dict[str, dict[str, str]] = {
    "H1": {"out1": "/H1_F1", "out2": "/H1_R1R2", "in1": "/R3_G2H1", "in2": "/R1_H1R2"},
    "F1": {"in1": "/H1_F1", "out1": "/F1_R2R3"},
    "R1": {"in1": "/H1_R1R2", "out1": "/R1_H1R2"},
    "R2": {
        "in1": "/F1_R2R3",
        "in2": "/H1_R1R2",
        "in3": "/R1_H1R2",
        "in4": "/G2_R2",
        "out1": "/R2_R3",
    },
    "R3": {"in1": "/F1_R2R3", "in2": "/R2_R3", "out1": "/R3_G2H1"},
}

ORDER = ["/H1", "/F1", "/R1", "/R2", "/R3"]

# Connections that are also ROS topics.
WHITELIST = ".*R3_G2H1|.*R1_H1R2|.*G2_R2"


def component(name: str) -> graph_pb2.ComponentSpec:
    """Return a component of the figure.

    H1 stands for the hardware: it runs first in each cycle and reads the values that the
    other components wrote in the previous cycle.
    """
    wires = WIRES[name]
    remaps = [f"{port}:={wires.get(port, f'~{port}')}" for port in PORTS]
    return rtcf.component("rtcf_examples", "Mimo", name=name, remaps=remaps, first=name == "H1")
