"""The rosrun tools component_list, component_info, component_order, connection_list and
connection_info: rtcfctl's views of a runner of a launch, wherever its rtcfd is."""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import rtcf
from rtcfctl.graph import component, wires
from rtcfctl.terminal.output import Output

from rtcf_launch import arguments, rendezvous
from rtcf_launch.master import Master, MasterSilent
from rtcf_launch.runner_node import runner_name

DONE, REFUSED, USAGE, UNREACHABLE = range(4)
_CALL_S = 1.0

Show = Callable[[rtcf.Client, argparse.Namespace, Output], None]

# Of each tool: what it says of itself, what it names, what it shows.
TOOLS: dict[str, tuple[str, str, Show]] = {
    "component_list": ("the components of a loop, in their order", "", component.show_all),
    "component_info": ("one component, with its values", "component", component.show),
    "component_order": ("the order in which the components run", "", wires.show_order),
    "connection_list": ("the connections of a loop", "", wires.show_connections),
    "connection_info": ("one connection: who writes and who reads", "connection",
                        wires.show_connection),
}  # fmt: skip


def main(tool: str, argv: Sequence[str] | None = None, build_tree: Path | None = None) -> int:
    """Run one of the tools; return its exit status, as rtcfctl's."""
    del build_tree  # the tools start nothing
    given = arguments.parse(sys.argv[1:] if argv is None else argv, os.environ, tool)
    args = _parser(tool).parse_args(given.words)
    try:
        socket, args.runner = _place(args, given)
        with rtcf.Client(socket) as client:
            TOOLS[tool][2](client, args, Output(args.output))
            sys.stdout.flush()
    except rtcf.DaemonUnreachableError as error:
        return _fail(tool, error, UNREACHABLE)
    except rtcf.RtcfError as error:
        return _fail(tool, error, REFUSED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return DONE


def _parser(tool: str) -> argparse.ArgumentParser:
    text, named, _ = TOOLS[tool]
    parser = argparse.ArgumentParser(
        prog=f"rosrun rtcf {tool}",
        description=f"Shows {text}.",
        epilog="Without --socket the runner is looked for at the ROS master, where rt_runner says "
        "where it is, then in the system's rtcfd. Exit codes: 0 done, 1 refused, 2 usage, "
        "3 rtcfd not reachable.",
    )
    if named:
        parser.add_argument(named, metavar=named.upper())
    parser.add_argument(
        "-r", "--runner", default="rt_runner", metavar="NAME",
        help="rt_runner's node name, or a runner of rtcfd (default: rt_runner)",
    )  # fmt: skip
    parser.add_argument(
        "--socket", default=os.environ.get("RTCF_SOCKET"), metavar="PATH",
        help="rtcfd's control socket (default: $RTCF_SOCKET)",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", choices=("table", "json", "yaml"), default="table", help="output format"
    )
    return parser


def _place(args: argparse.Namespace, given: arguments.Arguments) -> tuple[str | None, str]:
    """Return the socket and the runner's name there."""
    if args.socket:
        return args.socket, runner_name(args.runner)
    master = Master(given.master_uri, given.full_name, _CALL_S)
    try:
        for node in arguments.upward(args.runner, given.ns):
            meeting = rendezvous.find(master, node)
            if meeting is not None and not meeting.starting and meeting.host == rendezvous.host():
                return meeting.socket, meeting.runner
    except MasterSilent:
        pass
    return None, runner_name(args.runner)


def _fail(tool: str, error: Any, code: int) -> int:
    print(f"{tool}: {' '.join(str(error).split())}", file=sys.stderr)
    return code
