"""rt_launcher: loads a component into the runner of its launch, for as long as it lives.

Exit statuses: codes.py.
"""

import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rtcf
from rtcf.v1 import control_pb2, graph_pb2

from rtcf_launch import arguments, component_parameters, rendezvous
from rtcf_launch.codes import Code, Ending
from rtcf_launch.inbox import Asked, Inbox, Lost
from rtcf_launch.master import Master, MasterSilent
from rtcf_launch.rendezvous import Meeting
from rtcf_launch.screen import Screen

_POLL_S = 0.2
_SAY_AFTER_S = 5.0
_SAY_AGAIN_S = 60.0
# rtcfd waits as long for us after its restart; a little more for the restart itself.
_RETURN_S = 15.0
_RETRY_S = 0.3
_END_S = 3.0

USAGE = """\
usage: rosrun rtcf rt_launcher PACKAGE COMPONENT [__name:=NAME] [FROM:=TO]... [_PARAMETER:=VALUE]...

Loads a component into the loop of an rt_runner, and unloads it at its own end.

private parameters; all others are values of parameters that the component declares:
  runner                   name of the rt_runner (default: the nearest one named rt_runner)
  is_first                 all connections into it are loop breaks
  topics_ignore_for_graph  regular expression, or a list: connections that are, for it
  every, phase             run in each n-th cycle, and in which of them
  optional                 after a fault the loop goes on without it
  on_lease_lost            if this process dies: stop the loop and unload (stop, the default),
                           unload, or keep

exit status: 0 asked to end, 1 refused, 2 wrong arguments or parameters, 3 the component failed
or was taken out, 4 its runner has gone
"""

_CODES = {
    control_pb2.LeaseEnded.WHY_ASKED: Code.DONE,
    control_pb2.LeaseEnded.WHY_UNLOADED: Code.FAILED,
    control_pb2.LeaseEnded.WHY_FAILED: Code.FAILED,
    control_pb2.LeaseEnded.WHY_RUNNER_ENDED: Code.LOST,
    control_pb2.LeaseEnded.WHY_DAEMON_ENDED: Code.LOST,
}


class LauncherNode:
    """One rt_launcher."""

    def __init__(self, given: arguments.Arguments) -> None:
        self._given = given
        self._node = given.full_name
        self._screen = Screen(self._node)
        self._inbox = Inbox()
        self._master = Master(given.master_uri, self._node)
        self._run_id = ""
        self._spec = graph_pb2.ComponentSpec()
        self._tenancy: rtcf.Tenancy | None = None
        self._client: rtcf.Client | None = None
        self._loaded = False
        self._lost_since: float | None = None

    def run(self) -> Code:
        """Serve until it is asked to end or something ends it."""
        try:
            self._parameters = self._read_parameters()
            return self._serve()
        except (Ending, MasterSilent, rtcf.RtcfError) as error:
            code = error.code if isinstance(error, Ending) else Code.REFUSED
            if code != Code.DONE:
                self._screen.error(str(error))
            return code
        finally:
            if self._client is not None:
                self._client.close()

    def _read_parameters(self) -> component_parameters.LauncherParameters:
        for name, value in self._given.private.items():
            self._master.set(f"{self._node}/{name}", value)
        values = self._master.parameter(self._node, {})
        self._run_id = str(self._master.parameter("/run_id", "")) or f"{os.getpid()}"
        return component_parameters.read(values if isinstance(values, dict) else {})

    # -- the runner ---------------------------------------------------------

    def _find_runner(self) -> Meeting:
        """Wait for the runner, which may start after us."""
        begin = time.monotonic()
        say_at = begin + _SAY_AFTER_S
        while True:
            node, meeting = self._look()
            if meeting is not None and meeting.host != rendezvous.host():
                raise Ending(
                    Code.REFUSED,
                    f"runner {node} is on {meeting.host}, this launcher on {rendezvous.host()}: "
                    "start both on one machine",
                )
            if meeting is not None and rendezvous.alive(meeting):
                return meeting
            now = time.monotonic()
            if now > say_at:
                self._screen.info(f"waiting for runner {node} for {now - begin:.0f} s")
                say_at = now + _SAY_AGAIN_S
            if self._inbox.pause(_POLL_S):
                raise Ending(Code.DONE)

    def _look(self) -> tuple[str, Meeting | None]:
        """Return the node of the runner, and where it is if that is known."""
        named = self._parameters.runner
        if named is not None:
            node = arguments.resolve(named, self._given.ns)
            return node, rendezvous.find(self._master, node)
        # The nearest one: roslaunch has set the parameters of all nodes before it starts any.
        nodes = arguments.upward("rt_runner", self._given.ns)
        for node in nodes:
            if self._master.has(node):
                return node, rendezvous.find(self._master, node)
        return nodes[0], None

    # -- the component ------------------------------------------------------

    def _load(self, meeting: Meeting) -> None:
        self._meeting = meeting
        self._client = rtcf.Client(meeting.socket)
        package, type_name = self._given.words
        spec = rtcf.component(
            package,
            type_name,
            name=self._given.name,
            ns=self._given.ns,
            first=self._parameters.first,
            ignore=self._parameters.ignore,
            every=self._parameters.every,
            phase=self._parameters.phase,
            optional=self._parameters.optional,
        )
        for source, target in self._given.remaps:
            spec.remaps.add(**{"from": source, "to": target})
        offered = {each.type: each for each in self._client.list_types(package).types}
        # A type that is not there is refused by rtcfd, which knows why.
        declared = {each.name: each for each in offered[type_name].parameters} if (
            type_name in offered
        ) else {}  # fmt: skip
        if type_name in offered:
            values, rest = component_parameters.settings(self._parameters.others, declared)
            spec.parameters.extend(values)
            if rest:
                names = ", ".join(f"~{name}" for name in rest)
                self._screen.info(f"left to the component's node handle: {names}")
        self._spec = spec
        self._lease()

    def _lease(self, attach: bool = False) -> None:
        assert self._client is not None
        self._tenancy = self._client.lease_component(
            control_pb2.OpenLease(
                runner=self._meeting.runner,
                component=self._spec,
                on_lost=self._parameters.on_lost,
                run_id=self._run_id,
                holder=f"rt_launcher {self._node} (pid {os.getpid()})",
                hold=self._meeting.token,
                attach=attach,
                wait=True,
            )
        )
        self._inbox.read(self._tenancy)

    def _serve(self) -> Code:
        self._load(self._find_runner())
        deadline: float | None = None  # for the end that was asked for
        while True:
            left = None if deadline is None else max(deadline - time.monotonic(), 0.0)
            event = self._inbox.get(left)
            if event is None:
                return Code.DONE  # rtcfd sees our end
            if isinstance(event, Asked):
                if self._tenancy is None or self._lost_since is not None:
                    return Code.DONE
                if deadline is None:
                    self._tenancy.end()
                    deadline = time.monotonic() + _END_S
                continue
            if isinstance(event, Lost):
                if deadline is not None:
                    return Code.DONE
                self._reconnect(event.error)
                continue
            kind = event.WhichOneof("kind")
            if kind == "progress" and event.progress.startswith("waiting"):
                self._screen.warn(event.progress)
            elif kind == "loaded":
                self._say_loaded(event.loaded)
            elif kind == "logs":
                self._screen.records(event.logs)
            elif kind == "ended":
                if deadline is not None:
                    return Code.DONE
                raise Ending(_CODES.get(event.ended.why, Code.LOST), event.ended.message)

    def _say_loaded(self, result: Any) -> None:
        if self._loaded:
            self._lost_since = None
            self._screen.info("rtcfd is back, the component is kept")
            return
        self._loaded = True
        kind = f"{self._spec.package}/{self._spec.type}"
        self._screen.info(f"{kind} loaded into runner {self._meeting.runner}")
        for note in result.notes:
            self._screen.warn(note)

    def _reconnect(self, error: rtcf.RtcfError) -> None:
        if isinstance(error, rtcf.RefusedError):
            if self._loaded:
                raise Ending(Code.LOST, str(error))
            if "holder of runner" in str(error):
                # It ended between our look and our call: wait for the next one.
                self._load(self._find_runner())
                return
            raise Ending(Code.REFUSED, str(error))
        now = time.monotonic()
        if self._lost_since is None:
            self._lost_since = now
            if self._loaded:
                self._screen.warn(f"{error}; the loop goes on, coming back")
        if not self._loaded or now - self._lost_since > _RETURN_S:
            raise Ending(Code.LOST, str(error))
        if self._inbox.pause(_RETRY_S):
            raise Ending(Code.DONE)
        self._lease(attach=True)


def main(argv: Sequence[str] | None = None, build_tree: Path | None = None) -> int:
    """Run rt_launcher; return its exit status."""
    words = sys.argv[1:] if argv is None else argv
    if "-h" in words or "--help" in words:
        print(USAGE, end="")
        return Code.DONE
    try:
        given = arguments.parse(words, os.environ, "")
    except ValueError as error:
        print(f"rt_launcher: {error}", file=sys.stderr)
        return Code.USAGE
    if len(given.words) != 2:
        print(
            f'rt_launcher: name a package and a component, as in args="rtcf_examples Mimo", '
            f"not {len(given.words)} words\n{USAGE}",
            file=sys.stderr,
            end="",
        )
        return Code.USAGE
    # By rosrun it may have no name: then it is that of the component type.
    given.name = given.name or given.words[1]
    return LauncherNode(given).run()
