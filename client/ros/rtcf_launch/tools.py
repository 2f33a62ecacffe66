"""The rosrun tools component_list, component_info, component_order, connection_list and
connection_info.

They print the output of RTCF 2021's tools, by a runner's ROS service, from any machine.  With
--table or -o, they print the output of rtcfctl for a runner of this machine.
"""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rtcf
from rtcfctl.graph import component, connections
from rtcfctl.terminal.output import Output

from rtcf_launch import arguments, runner_entry, runner_info, tcpros
from rtcf_launch.master import Master, MasterSilent
from rtcf_launch.runner_node import runner_name

DONE, REFUSED, USAGE, UNREACHABLE = range(4)
_CALL_S = 1.0
_ANSWER_S = 10.0
_SERVICE = "get_introspection_information"


@dataclass(frozen=True)
class Tool:
    """One of the tools."""

    text: str  # subject of the output, for the help text
    named: str  # argument that names a component or connection; empty = none
    lines: Callable[[Any, str], list[str]]  # of a rtcf_msgs/RunnerInfo
    show: Callable[[rtcf.Client, argparse.Namespace, Output], None]


TOOLS = {
    "component_list": Tool(
        "the components of a loop", "", runner_info.component_list, component.show_all
    ),
    "component_info": Tool(
        "one component and its ports", "component", runner_info.component_info, component.show
    ),
    "component_order": Tool(
        "the order in which the components run",
        "",
        runner_info.component_order,
        connections.show_order,
    ),
    "connection_list": Tool(
        "the connections of a loop", "", runner_info.connection_list, connections.show_connections
    ),
    "connection_info": Tool(
        "one connection, its writers and its readers", "connection", runner_info.connection_info,
        connections.show_connection,
    ),
}  # fmt: skip


def main(tool: str, argv: Sequence[str] | None = None, build_tree: Path | None = None) -> int:
    """Run one of the tools; return its exit status, as rtcfctl's."""
    del build_tree  # the tools start nothing
    given = arguments.parse(sys.argv[1:] if argv is None else argv, os.environ, tool)
    args = _parser(tool).parse_args(given.words)
    try:
        if args.output is None:
            _print(TOOLS[tool], _info(args, given), args)
        else:
            _show(TOOLS[tool], args, given)
        sys.stdout.flush()
    except runner_info.NotFoundError as error:
        print(error)
        return REFUSED
    except (rtcf.DaemonUnreachableError, tcpros.CallFailed, MasterSilent) as error:
        return _fail(tool, error, UNREACHABLE)
    except rtcf.RtcfError as error:
        return _fail(tool, error, REFUSED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return DONE


def _parser(tool: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"rosrun rtcf {tool}",
        description=f"Shows {TOOLS[tool].text}.",
        epilog="Calls the runner's ROS service. With --table or -o, queries rtcfd "
        "on this machine: that of --socket, else that of rt_runner at the ROS master, else the "
        "system's. Exit status: 0 success, 1 rejected or not found, 2 usage, 3 not reachable.",
    )
    if TOOLS[tool].named:
        parser.add_argument(TOOLS[tool].named, metavar=TOOLS[tool].named.upper())
    parser.add_argument(
        "-r", "--runner", default="rt_runner", metavar="NAME",
        help="rt_runner's node name, or a runner of rtcfd (default: rt_runner)",
    )  # fmt: skip
    parser.add_argument(
        "--socket", default=os.environ.get("RTCF_SOCKET"), metavar="PATH",
        help="rtcfd's control socket (default: $RTCF_SOCKET)",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", choices=("table", "json", "yaml"), help="show the output of rtcfctl"
    )
    parser.add_argument(
        "--table", dest="output", action="store_const", const="table", help="the same as -o table"
    )
    return parser


def _print(tool: Tool, info: Any, args: argparse.Namespace) -> None:
    for line in tool.lines(info, getattr(args, tool.named) if tool.named else ""):
        print(line)


def _show(tool: Tool, args: argparse.Namespace, given: arguments.Arguments) -> None:
    socket, args.runner = _place(args, given)
    with rtcf.Client(socket) as client:
        tool.show(client, args, Output(args.output))


def _info(args: argparse.Namespace, given: arguments.Arguments) -> Any:
    """Return the rtcf_msgs/RunnerInfo of a runner.  Raises CallFailed and MasterSilent."""
    from rtcf_msgs.srv import GetRunnerInfo  # takes a while

    master = Master(given.master_uri, given.full_name, _CALL_S)
    services = [f"{node}/{_SERVICE}" for node in arguments.upward(args.runner, given.ns)]
    for service in services:
        if uri := master.service_uri(service):
            found = tcpros.call(uri, service, GetRunnerInfo, given.full_name, _ANSWER_S)
            return found.runner_info
    raise tcpros.CallFailed(
        f"no {services[0]} at the ROS master {given.master_uri}: start rt_runner, select it with "
        "--runner, or show a runner of this machine with --table"
    )


def _place(args: argparse.Namespace, given: arguments.Arguments) -> tuple[str | None, str]:
    """Return the socket and the runner's name there."""
    if args.socket:
        return args.socket, runner_name(args.runner)
    master = Master(given.master_uri, given.full_name, _CALL_S)
    try:
        for node in arguments.upward(args.runner, given.ns):
            entry = runner_entry.find(master, node)
            if entry is not None and not entry.starting and entry.host == runner_entry.host():
                return entry.socket, entry.runner
    except MasterSilent:
        pass
    return None, runner_name(args.runner)


def _fail(tool: str, error: Any, code: int) -> int:
    print(f"{tool}: {' '.join(str(error).split())}", file=sys.stderr)
    return code
