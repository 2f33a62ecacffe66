"""rt_launcher: loads a component into the runner of its launch, and unloads it when it ends.

codes.py has the exit statuses.
"""

import contextlib
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rtcf
from rtcf.reasons import ExpressionInvalidError, HolderGoneError
from rtcf.v1 import control_pb2, graph_pb2

from rtcf_launch import arguments, component_parameters
from rtcf_launch.codes import Code, Ending
from rtcf_launch.component_choice import ComponentChoice
from rtcf_launch.inbox import EndRequest, Inbox, LeaseLost
from rtcf_launch.master import Master, MasterSilent
from rtcf_launch.ros_node import RosNode, wait_until_gone
from rtcf_launch.runner_choice import RunnerChoice
from rtcf_launch.runner_entry import RunnerEntry
from rtcf_launch.screen import Screen

_POLL_S = 0.2
_SAY_EVERY_S = 5.0
_PREDECESSOR_S = 10.0
_LAST_CALL_S = 0.5
# After its restart, rtcfd waits 10 s for the holders of leases; the restart itself takes time, too.
_RETURN_S = 15.0
_RETRY_S = 0.3
_END_S = 3.0
_IGNORE_ALL = ".*"

USAGE = """\
usage: rosrun rtcf rt_launcher [-f] [-c] PACKAGE [-c] COMPONENT [__name:=NAME] [FROM:=TO]...
                               [_PARAMETER:=VALUE]...

Loads a component into the loop of an rt_runner, and unloads it when this process ends.

-c, --component_info may precede PACKAGE and COMPONENT, as in RTCF 2021.

private parameters; all others are values of parameters that the component declares:
  runner                   name of the rt_runner (default: the nearest one named rt_runner, else
                           the only one of the launch)
  rt_package, rt_type      PACKAGE and COMPONENT, instead of arguments
  is_first                 all connections into the component are loop breaks; also as argument
                           -f, --is_first
  topics_ignore_for_graph  regular expression, or a list: connections into the component that are
                           loop breaks
  every, phase             run in each n-th cycle, and the first of these cycles
  optional                 continue the loop without the component after its fault
  on_lease_lost            if this process dies: stop the loop and unload (stop, the default),
                           unload, or keep
runner, every, phase, optional and on_lease_lost may have the prefix rtcf_; without it, they belong
to a component that declares them.

exit status: 0 ended on request, 1 an error, 2 invalid arguments or parameters, 3 the component
failed or was taken out, 4 its runner ended
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

    def __init__(self, given: arguments.Arguments, component: ComponentChoice) -> None:
        self._given = given
        self._component = component
        self._node = given.full_name
        self._screen = Screen(self._node)
        self._inbox = Inbox()
        self._master = Master(given.master_uri, self._node)
        self._ros_node: RosNode | None = None
        self._run_id = ""
        self._spec = graph_pb2.ComponentSpec()
        self._lease: rtcf.Lease | None = None
        self._client: rtcf.Client | None = None
        self._loaded = False
        self._lost_since: float | None = None

    def run(self) -> Code:
        """Load the component and wait for the end; return the exit status."""
        try:
            self._read_parameters()
            self._enter_ros()
            return self._serve()
        except (Ending, MasterSilent, rtcf.RtcfError) as error:
            code = error.code if isinstance(error, Ending) else Code.REFUSED
            if code != Code.DONE:
                self._screen.error(str(error))
            return code
        finally:
            if self._client is not None:
                self._client.close()
            # Last: a launcher that takes our name waits for this.
            if self._ros_node is not None:
                self._ros_node.end(Master(self._given.master_uri, self._node, _LAST_CALL_S))

    def _read_parameters(self) -> None:
        for name, value in self._given.private.items():
            self._master.set(f"{self._node}/{name}", value)
        values = self._master.parameter(self._node, {})
        self._values = values if isinstance(values, dict) else {}
        self._component = self._component.with_parameters(self._values)
        self._run_id = str(self._master.parameter("/run_id", "")) or f"{os.getpid()}"
        # Report errors that do not depend on the component before any wait.
        component_parameters.read(self._values)

    def _enter_ros(self) -> None:
        """Register as a node.  This displaces a node of the same name: wait until it has ended."""
        self._ros_node = RosNode(
            self._master,
            self._node,
            self._given.hostname,
            self._inbox.request_end,
            self._screen.set_level,
        )
        before = self._ros_node.register()
        self._ros_node.stay_registered(lambda: None)
        if before and not wait_until_gone(before, self._inbox.pause, _PREDECESSOR_S):
            raise Ending(
                Code.DONE if self._inbox.end_requested else Code.REFUSED,
                f"another node {self._node} exists and does not end",
            )

    # -- the runner ---------------------------------------------------------

    def _find_runner(self) -> RunnerEntry:
        """Wait for the runner, which may start later than this process."""
        named = component_parameters.named_runner(self._values)
        choice = RunnerChoice(self._master, self._given.ns, named)
        self._unnamed = (
            RunnerChoice(self._master, self._given.ns, None)
            if named is not None and f"{component_parameters.PREFIX}runner" not in self._values
            else None
        )
        begin = time.monotonic()
        say_at = begin + _SAY_EVERY_S
        while True:
            now = time.monotonic()
            with contextlib.suppress(MasterSilent):  # it may be restarting
                if entry := choice.poll() or self._poll_unnamed(now - begin):
                    return entry
            if now > say_at:
                self._screen.info(f"waiting for {now - begin:.0f} s for {choice.waiting}")
                say_at = now + _SAY_EVERY_S
            if self._inbox.pause(_POLL_S):
                raise Ending(Code.DONE)

    def _poll_unnamed(self, waited_s: float) -> RunnerEntry | None:
        """Return the runner chosen without ~runner if the component declares that parameter."""
        if waited_s < _SAY_EVERY_S or self._unnamed is None:
            return None
        entry = self._unnamed.poll()
        if entry is None:
            return None
        type_name = self._component.type
        with rtcf.Client(entry.socket) as client:
            offered = client.list_types(self._component.package).types
            types = {each.type: each for each in offered}
        declared = [each.name for each in types[type_name].parameters] if type_name in types else []
        self._unnamed = None  # asked once
        return entry if "runner" in declared else None

    # -- the component ------------------------------------------------------

    def _load(self, entry: RunnerEntry) -> None:
        self._entry = entry
        self._screen.use_daemon(entry.socket)
        self._client = rtcf.Client(entry.socket)
        package, type_name = self._component.package, self._component.type
        offered = {each.type: each for each in self._client.list_types(package).types}
        # rtcfd rejects an unknown type, and its error has the reason.
        declared = (
            {each.name: each for each in offered[type_name].parameters}
            if type_name in offered
            else {}
        )
        self._parameters, notes = component_parameters.read(self._values, declared)
        spec = rtcf.component(
            package,
            type_name,
            name=self._given.name,
            ns=self._given.ns,
            first=self._component.first or self._parameters.first,
            ignore=self._parameters.ignore,
            every=self._parameters.every,
            phase=self._parameters.phase,
            optional=self._parameters.optional,
        )
        for source, target in self._given.remaps:
            spec.remaps.add(source=source, target=target)
        if type_name in offered:
            values, rest, slips = component_parameters.settings(self._parameters.others, declared)
            spec.parameters.extend(values)
            notes += slips
            if rest:
                names = ", ".join(f"~{name}" for name in rest)
                self._screen.info(f"parameters for the component's node handle: {names}")
        for note in notes:
            self._screen.warn(note)
        self._spec = spec
        self._take_lease()

    def _take_lease(self, attach: bool = False) -> None:
        assert self._client is not None
        self._lease = self._client.lease_component(
            control_pb2.OpenLease(
                runner=self._entry.runner,
                component=self._spec,
                on_lost=self._parameters.on_lost,
                run_id=self._run_id,
                holder=f"rt_launcher {self._node} (pid {os.getpid()})",
                hold=self._entry.token,
                attach=attach,
                wait=True,
                unseen=_prints_to_log(self._given.log_file),
            )
        )
        self._inbox.read(self._lease)

    def _serve(self) -> Code:
        self._load(self._find_runner())
        deadline: float | None = None  # of the requested end
        while True:
            left = None if deadline is None else max(deadline - time.monotonic(), 0.0)
            event = self._inbox.get(left)
            if event is None:
                return Code.DONE  # rtcfd sees our end
            if isinstance(event, EndRequest):
                if event.why:
                    self._screen.warn(f"asked to end: {event.why}")
                if self._lease is None or self._lost_since is not None:
                    return Code.DONE
                if deadline is None:
                    self._lease.end()
                    deadline = time.monotonic() + _END_S
                continue
            if isinstance(event, LeaseLost):
                if deadline is not None:
                    return Code.DONE
                self._reconnect(event.error)
                continue
            kind = event.WhichOneof("kind")
            if kind == "waiting":
                self._screen.warn(event.waiting)
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
        self._screen.info(f"{kind} loaded into runner {self._entry.runner}")
        for note in result.notes:
            self._screen.warn(note)

    def _reconnect(self, error: rtcf.RtcfError) -> None:
        if isinstance(error, ExpressionInvalidError) and self._spec.ignore != _IGNORE_ALL:
            # As RTCF 2021.
            self._screen.error(
                f"~topics_ignore_for_graph: {error}; falling back to '{_IGNORE_ALL}'"
            )
            self._spec.ignore = _IGNORE_ALL
            self._take_lease()
            return
        if isinstance(error, rtcf.RefusedError):
            if self._loaded:
                raise Ending(Code.LOST, str(error))
            if isinstance(error, HolderGoneError):
                # The runner ended after it was found: wait for the next one.
                self._load(self._find_runner())
                return
            raise Ending(Code.REFUSED, str(error))
        now = time.monotonic()
        if self._lost_since is None:
            self._lost_since = now
            if self._loaded:
                self._screen.warn(f"{error}; the loop continues; reconnecting")
        if not self._loaded or now - self._lost_since > _RETURN_S:
            raise Ending(Code.LOST, str(error))
        if self._inbox.pause(_RETRY_S):
            raise Ending(Code.DONE)
        self._take_lease(attach=True)


def _prints_to_log(log_file: str) -> bool:
    """Return whether standard output is the file that roslaunch uses without output="screen"."""
    try:
        there = os.stat(f"{log_file.removesuffix('.log')}-stdout.log")
        return os.path.samestat(os.fstat(sys.stdout.fileno()), there)
    except OSError:
        return False


def main(argv: Sequence[str] | None = None, build_tree: Path | None = None) -> int:
    """Run rt_launcher; return its exit status."""
    words = sys.argv[1:] if argv is None else argv
    if "-h" in words or "--help" in words:
        print(USAGE, end="")
        return Code.DONE
    try:
        given = arguments.parse(words, os.environ, "")
        component = ComponentChoice.parse(given.words)
    except (ValueError, Ending) as error:
        print(f"rt_launcher: {error}\n{USAGE}", file=sys.stderr, end="")
        return Code.USAGE
    # Without a name, as from rosrun, the component type is the name.
    given.name = given.name or component.type.rpartition("::")[2] or "rt_launcher"
    return LauncherNode(given, component).run()
