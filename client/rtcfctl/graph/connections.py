"""`rtcfctl order|connections|break|unbreak`."""

import argparse
import difflib
from typing import Any

import rtcf
from rtcf.v1 import graph_pb2

from rtcfctl.terminal.output import Output


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verbs."""
    order = verbs.add_parser(
        "order", parents=[common], help="list the components in the order in which they run"
    )
    order.set_defaults(run=show_order)
    connections = verbs.add_parser("connections", parents=[common], help="list all connections")
    connections.set_defaults(run=show_connections)
    for verb, broken, text in (
        ("break", True, "make connections into inputs loop breaks"),
        ("unbreak", False, "remove loop breaks from inputs"),
    ):
        breaking = verbs.add_parser(verb, parents=[common], help=text)
        breaking.add_argument("ports", metavar="COMPONENT.PORT", nargs="+")
        breaking.set_defaults(run=set_breaks, broken=broken)


def show_order(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print the components in the order in which they run."""
    order = client.get_order(args.runner)
    if output.for_people:
        print("\n".join(order))
    else:
        output.data(order)


def show_connections(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print writers and readers of each mapped name."""
    connections = client.list_connections(args.runner)
    if not output.for_people:
        output.data(connections)
        return
    output.table(
        ("connection", "type", "writer", "readers", "ROS"),
        (
            (
                each.name,
                each.type,
                _writers(each) or "-",
                ", ".join(_end(reader) for reader in each.readers) or "-",
                _ros(each),
            )
            for each in connections
        ),
    )


def show_connection(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print one connection."""
    wanted = args.connection if args.connection.startswith("/") else "/" + args.connection
    connections = {each.name: each for each in client.list_connections(args.runner)}
    found = connections.get(wanted)
    if found is None:
        close = difflib.get_close_matches(wanted, connections, n=1)
        hint = f"; did you mean {close[0]}?" if close else ""
        raise rtcf.RefusedError(f"no connection {wanted}{hint}", "NOT_FOUND")
    if not output.for_people:
        output.data(found)
        return
    output.line(f"{found.name}: {found.type}", "bold")
    output.line(f"  written by {_writers(found) or 'no component'}")
    for reader in found.readers:
        output.line(f"  read by {_end(reader)}")
    if ros := _ros(found):
        output.line(f"  {ros} as a ROS topic")


def set_breaks(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Set or remove loop breaks."""
    ports = [rtcf.parse_port(text) for text in args.ports]
    result = client.set_breaks(ports, args.broken, args.runner, output.progress)
    verb = "broken" if args.broken else "unbroken"
    output.changed(f"{verb}: {', '.join(args.ports)}", result)


def _writers(connection: Any) -> str:
    first = [connection.writer] if connection.HasField("writer") else []
    return ", ".join(_end(each) for each in [*first, *connection.other_writers])


def _end(endpoint: graph_pb2.Endpoint) -> str:
    mark = " (loop break)" if endpoint.broken else ""
    return f"{endpoint.component}.{endpoint.port}{mark}"


def _ros(connection: graph_pb2.Connection) -> str:
    if connection.published:
        return "published"
    return "subscribed" if connection.subscribed else ""
