"""Client library of rtcf.

    import rtcf

    with rtcf.Client() as client:
        client.load(rtcf.component("rtcf_examples", "Mimo", name="H1", remaps=["in1:=/a"]))
        client.start()

Requests and answers are the protobuf messages of rtcf.v1.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from rtcf_shared.errors import RtcfError

from rtcf.client import Client, default_socket
from rtcf.errors import DaemonUnreachableError, RefusedError
from rtcf.tenancy import Tenancy

if TYPE_CHECKING:
    from rtcf_shared.graph_reader import Graph, GraphFileError, read_graphs
    from rtcf_shared.graph_writer import live_spec, write_graphs
    from rtcf_shared.spec import component, parse_parameter, parse_port, parse_remap, parse_value

__version__ = "0.1.0"

# Imported when they are used first: a command is short, and few need them.
_LATER = {
    "Graph": "graph_reader",
    "GraphFileError": "graph_reader",
    "read_graphs": "graph_reader",
    "live_spec": "graph_writer",
    "write_graphs": "graph_writer",
    "component": "spec",
    "parse_parameter": "spec",
    "parse_port": "spec",
    "parse_remap": "spec",
    "parse_value": "spec",
}

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


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"rtcf_shared.{_LATER[name]}"), name)
