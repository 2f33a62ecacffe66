"""Client library of rtcf.

    import rtcf

    with rtcf.Client() as client:
        client.load(rtcf.component("rtcf_examples", "Mimo", name="H1", remaps=["in1:=/a"]))
        client.start()

Requests and results are the protobuf messages of rtcf.v1.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rtcf_shared.errors import RtcfError
    from rtcf_shared.graph_reader import Graph, GraphFileError, read_graphs
    from rtcf_shared.graph_writer import live_spec, write_graphs
    from rtcf_shared.spec import component, parse_parameter, parse_port, parse_remap, parse_value

    from rtcf.client import Client
    from rtcf.connection import default_socket
    from rtcf.errors import DaemonUnreachableError, RefusedError
    from rtcf.lease import Lease
    from rtcf.recording.reader import Recording, RecordingError, read_recording

__version__ = "0.1.0"

# Imported at their first use: imports dominate the time of a short command, and rtcfd imports only
# rtcf.v1 and rtcf.executor.
_LATER = {
    "Client": "rtcf.client",
    "DaemonUnreachableError": "rtcf.errors",
    "Graph": "rtcf_shared.graph_reader",
    "GraphFileError": "rtcf_shared.graph_reader",
    "Lease": "rtcf.lease",
    "Recording": "rtcf.recording.reader",
    "RecordingError": "rtcf.recording.reader",
    "RefusedError": "rtcf.errors",
    "RtcfError": "rtcf_shared.errors",
    "component": "rtcf_shared.spec",
    "default_socket": "rtcf.connection",
    "live_spec": "rtcf_shared.graph_writer",
    "parse_parameter": "rtcf_shared.spec",
    "parse_port": "rtcf_shared.spec",
    "parse_remap": "rtcf_shared.spec",
    "parse_value": "rtcf_shared.spec",
    "read_graphs": "rtcf_shared.graph_reader",
    "read_recording": "rtcf.recording.reader",
    "write_graphs": "rtcf_shared.graph_writer",
}

__all__ = [
    "Client",
    "DaemonUnreachableError",
    "Graph",
    "GraphFileError",
    "Lease",
    "Recording",
    "RecordingError",
    "RefusedError",
    "RtcfError",
    "component",
    "default_socket",
    "live_spec",
    "parse_parameter",
    "parse_port",
    "parse_remap",
    "parse_value",
    "read_graphs",
    "read_recording",
    "write_graphs",
]


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(_LATER[name]), name)
    return found
