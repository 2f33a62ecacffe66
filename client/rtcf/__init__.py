"""Client library of rtcf.

    import rtcf

    with rtcf.Client() as client:
        client.load(rtcf.component("rtcf_examples", "Mimo", name="H1", remaps=["in1:=/a"]))
        client.start()

Requests and answers are the protobuf messages of rtcf.v1.
"""

from rtcf_shared.errors import RtcfError
from rtcf_shared.graph_reader import Graph, GraphFileError, read_graphs
from rtcf_shared.graph_writer import live_spec, write_graphs
from rtcf_shared.spec import component, parse_parameter, parse_port, parse_remap, parse_value

from rtcf.client import Client, default_socket
from rtcf.errors import DaemonUnreachableError, RefusedError
from rtcf.tenancy import Tenancy

__version__ = "0.1.0"

__all__ = [
    "Client",
    "DaemonUnreachableError",
    "Graph",
    "GraphFileError",
    "RefusedError",
    "RtcfError",
    "Tenancy",
    "component",
    "default_socket",
    "live_spec",
    "parse_parameter",
    "parse_port",
    "parse_remap",
    "parse_value",
    "read_graphs",
    "write_graphs",
]
