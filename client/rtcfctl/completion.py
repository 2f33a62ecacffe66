"""Completes command lines for shells: verbs and options from the parser, names from rtcfd.

The shell calls `rtcfctl __complete WORD...` with the words after rtcfctl, of which
it completes the last one (see completion/rtcfctl).  Each candidate is one line.
"""

import argparse
import contextlib
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import rtcf
from rtcf.connection import DEFAULT_SOCKET
from rtcf.v1 import graph_pb2


def candidates(parser: argparse.ArgumentParser, words: Sequence[str]) -> list[str]:
    """Return the candidates for the last word; empty for a file or a free value."""
    *before, prefix = words or [""]
    line = _Line(parser)
    for word in before:
        line.take(word)
    try:
        return sorted({word for word in line.next(prefix) if word.startswith(prefix)})
    except rtcf.RtcfError:
        return []  # do not print errors at a shell's prompt


def _asleep(socket: str) -> bool:
    """Return whether a connection would start the system's rtcfd, which completion must not do."""
    if socket != DEFAULT_SOCKET:
        return False
    try:
        asked = subprocess.run(["systemctl", "is-active", "--quiet", "rtcfd.service"])
    except OSError:
        return False  # without systemd, no socket activation
    return asked.returncode != 0


def _declared(client: rtcf.Client, package: str, type_name: str, source: str) -> Iterator[str]:
    """Yield the parameters, ports or inputs of the component type to load."""
    for each in client.list_types(package).types:
        if each.type != type_name:
            continue
        if source == "NAME:=VALUE":
            yield from (f"{parameter.name}:=" for parameter in each.parameters)
        elif source == "FROM:=TO":
            yield from (f"{port.name}:=" for port in each.ports)
        else:
            inputs = (p for p in each.ports if p.direction == graph_pb2.DIRECTION_INPUT)
            yield from (str(port.name) for port in inputs)


def _ports(client: rtcf.Client, runner: str, direction: graph_pb2.Direction) -> Iterator[str]:
    """Yield the ports of one direction of all components."""
    for component in client.list_components(runner):
        name = component.full_name.removeprefix("/")
        yield from (
            f"{name}.{port.name}" for port in component.ports if port.direction == direction
        )


class _Line:
    """The meaning of the words before the completed one."""

    def __init__(self, parser: argparse.ArgumentParser) -> None:
        self._parser = parser
        self._verbs: list[str] = []
        self._given: list[str] = []  # positional words of the verb
        self._option: argparse.Action | None = None  # waits for its value
        self._values: dict[str, str] = {}

    def take(self, word: str) -> None:
        """Parse one word."""
        if self._option is not None:
            self._values[self._option.dest] = word
            self._option = None
        elif word.startswith("-"):
            name, equals, value = word.partition("=")
            action = self._parser._option_string_actions.get(name)
            if action is not None and action.nargs != 0:
                if equals:
                    self._values[action.dest] = value
                else:
                    self._option = action
        elif (below := self._sub_parsers()) is not None:
            self._verbs.append(word)
            # An unknown verb has no candidates.
            self._parser = below.get(word, argparse.ArgumentParser(add_help=False))
        else:
            self._given.append(word)

    def next(self, prefix: str) -> Iterator[str]:
        """Yield the candidates for the next word."""
        if self._option is not None:
            yield from self._of(self._option)
        elif prefix.startswith("-"):
            yield from self._parser._option_string_actions
        elif (below := self._sub_parsers()) is not None:
            yield from below
        elif (action := self._positional()) is not None:
            yield from self._of(action)

    def _sub_parsers(self) -> dict[str, argparse.ArgumentParser] | None:
        for action in self._parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                return dict(action.choices)
        return None

    def _positional(self) -> argparse.Action | None:
        left = len(self._given)
        for action in self._parser._actions:
            if action.option_strings:
                continue
            if action.nargs in ("+", "*") or left == 0:
                return action
            left -= 1
        return None

    def _of(self, action: argparse.Action) -> Iterable[Any]:
        if action.choices is not None:
            return action.choices
        source = action.metavar if isinstance(action.metavar, str) else ""
        if source == "NAME" and ("runner" in self._verbs or action.dest == "runner"):
            source = "RUNNER"
        if "host" in self._values:
            return []  # ssh might ask for a password
        with rtcf.Client(self._values.get("socket")) as client:
            return [] if _asleep(client.socket) else list(self._live(client, source))

    def _live(self, client: rtcf.Client, source: str) -> Iterator[str]:
        """Yield names from rtcfd."""
        runner = self._values.get("runner", "")
        if source == "RUNNER":
            yield from (str(each.runner) for each in client.get_status().runners)
        elif source == "NAME":
            yield from client.get_order(runner)
            yield from (name.removeprefix("/") for name in client.get_order(runner))
        elif source == "INCIDENT":
            yield from (str(each.name) for each in client.list_incidents())
        elif source == "PKG":
            yield from (str(each.package) for each in client.list_types().types)
        elif source == "PKG/COMPONENT":
            yield from (f"{each.package}/{each.type}" for each in client.list_types().types)
        elif source == "COMPONENT" and self._given:
            types = client.list_types(self._given[-1]).types
            yield from (str(each.type) for each in types)
        elif source in ("NAME:=VALUE", "FROM:=TO", "PORT") and len(self._given) > 1:
            yield from _declared(client, self._given[-2], self._given[-1], source)
        elif source == "COMPONENT.PORT":
            yield from _ports(client, runner, graph_pb2.DIRECTION_INPUT)
        elif source in ("CONDITION", "OUTPUT"):
            yield from _ports(client, runner, graph_pb2.DIRECTION_OUTPUT)
        elif source in ("PARAMETER", "PARAMETER:=VALUE") and self._given:
            with contextlib.suppress(rtcf.RefusedError):
                info = client.get_component(self._given[0], runner)
                after = source.removeprefix("PARAMETER").removesuffix("VALUE")
                yield from (f"{parameter.name}{after}" for parameter in info.parameters)
