"""rt_runner: leases a runner for the life of a launch, and starts its loop as ~mode says.

codes.py has the exit statuses.
"""

import contextlib
import os
import re
import secrets
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rtcf
from rtcf.private_daemon import PrivateDaemon, program
from rtcf.reasons import ExpressionInvalidError
from rtcf.v1 import control_pb2, runner_pb2
from rtcf_shared.enums import word

from rtcf_launch import arguments, loop_statistics, runner_entry, runner_parameters
from rtcf_launch.codes import Code, Ending
from rtcf_launch.daemon_choice import choose
from rtcf_launch.inbox import EndRequest, Inbox, LeaseLost, MasterBack
from rtcf_launch.master import Master, MasterSilent
from rtcf_launch.ros_node import RosNode, wait_until_gone
from rtcf_launch.screen import Screen, system_socket

# After its restart, rtcfd waits 10 s for the holders of leases; the restart itself takes time, too.
_RETURN_S = 15.0
_RETRY_S = 0.3
_PREDECESSOR_S = 5.0
_DISPLACED_S = 10.0
_END_S = 3.0
_LAST_CALL_S = 0.5
_CHECK_S = 1.0  # between two checks of the loop and its node
_STATISTICS_S = 1.0  # timeout of a query for statistics
_FIXED_NAMES = ("/rosout", "/diagnostics", "/clock")  # of the loop's node, besides those below it

USAGE = """\
usage: rosrun rtcf rt_runner [__name:=NAME] [_PARAMETER:=VALUE]...

Holds a real-time loop for the life of a launch; rt_launcher loads components into it.

private parameters:
  frequency                cycles per second, 0.1 to 50000 (default: 1000)
  graph                    graph file: its components and settings (default: none)
  mode                     wait_for_components, no_wait or wait_for_trigger
  num_components_expected  for wait_for_components: start when this number is loaded
  ros_mapping_whitelist    regular expression: connections that become ROS topics
  ros_mapping_blacklist    exceptions from it
  ros_queue                messages kept for a slow subscriber (default: 1000)
  wait_policy              after a late cycle: absolute (catch up) or relative
  overrun                  the same with all choices: skip (default), catch_up, relative
  max_overruns             stop the loop when its leaky bucket of overruns exceeds this number;
                           0: never
  cpu_affinity_mask, cpu   CPU of the loop: one bit per CPU (the last permitted one counts), or
                           its number
  priority                 of SCHED_FIFO, 1 to 98 (default: 80 at 1 kHz, more for faster loops)
  spin                     busy wait before each cycle, in us, or "auto" (default: 0)
  realtime                 without real-time rights: reject the start (required), or run with a
                           warning (preferred)
  lock_memory, safe_heap_size_kB, safe_stack_size_kB
                           memory that is locked, and allocated at the start
  stall_timeout            end the executor if a cycle takes longer, in s; 0: never (default: 2)
  hook_timeout             fail a change if a hook outside the cycle takes longer, in s
                           (default: 10)
  warmup_cycles            first cycles that the statistics exclude (default: 10)
  ros_latch                regular expression: topics whose last message late subscribers get
  ros_decimation, ros_decimate
                           of the topics that match, publish each n-th value (default: 1, .*)
  ros_stamped              regular expression: topics of numbers and bools that have a header with
                           the time of the cycle
  ros_largest_message_kB   of types of variable size, in both directions (default: 256)
  ros_peers                right of ROS peers: none, observe, tune, operate, admin (default: your
                           right)
  sim_time                 follow /clock: auto (default: if /use_sim_time), never, always
  max_clock_jump           a larger forward jump of a simulated clock re-bases the loop, in s
                           (default: 10)
  on_crash                 after a crash: keep the loop stopped (hold, the default), or resume it
                           without the crashed component if that is optional (resume)
  on_fault                 when the loop ends by a fault: exit (default), or stay
  daemon                   rtcfd to use: auto (default), system or private

exit status: 0 ended on request, 1 an error, 2 invalid parameters, 3 the loop ended by a fault,
4 rtcfd ended
"""


class RunnerNode:
    """One rt_runner."""

    def __init__(self, given: arguments.Arguments, build_tree: Path | None) -> None:
        self._given = given
        self._build_tree = build_tree
        self._node = given.full_name
        self._runner = runner_name(self._node)
        self._screen = Screen(self._node)
        self._inbox = Inbox()
        self._master = Master(given.master_uri, own_node(self._node))
        self._daemon: PrivateDaemon | None = None
        self._lease: rtcf.Lease | None = None
        self._client: rtcf.Client | None = None
        self._ros_node: RosNode | None = None
        self._announced = False
        self._over = threading.Event()
        self._said_missing: set[str] = set()
        self._was_running = False
        self._fault = ""
        self._complete = False
        self._warmup_cycles = 0
        self._taken_once = False
        self._token = ""
        self._lost_since: float | None = None

    def run(self) -> Code:
        """Lease the runner and wait for the end; return the exit status."""
        try:
            self._parameters = self._read_parameters()
            self._enter_ros()
            self._take()
            return self._serve()
        except (Ending, MasterSilent, rtcf.RtcfError) as error:
            code = error.code if isinstance(error, Ending) else Code.REFUSED
            if code != Code.DONE:
                self._screen.error(str(error))
            return code
        finally:
            self._end()
            # Last: a runner that takes our name waits for this.
            if self._ros_node is not None:
                self._ros_node.end(self._last_calls())

    # -- the start ----------------------------------------------------------

    def _read_parameters(self) -> runner_parameters.RunnerParameters:
        for name, value in self._given.private.items():
            self._master.set(f"{self._node}/{name}", value)
        values = self._master.parameter(self._node, {})
        parameters, lines = runner_parameters.read(values if isinstance(values, dict) else {})
        for line in lines:
            self._screen.warn(line)
        parameters.settings.ros.master_uri = self._given.master_uri
        parameters.settings.ros.hostname = self._given.hostname
        parameters.settings.ros.ns = self._node
        self._warn_of_remaps()
        return parameters

    def _warn_of_remaps(self) -> None:
        """Warn of remaps of the loop's own names.  Others may be for all nodes of the launch."""
        for source, target in self._given.remaps:
            name = arguments.resolve(source.replace("~", f"{self._node}/", 1), self._given.ns)
            if name in _FIXED_NAMES or name.startswith(f"{self._node}/"):
                self._screen.warn(
                    f"remap of {source} to {target} ignored: the names of the loop's own topics "
                    "and services are fixed; remap them in the nodes that use them"
                )

    def _enter_ros(self) -> None:
        """Register as a node.  This displaces a node of the same name: wait until it has ended."""
        self._ros_node = RosNode(
            self._master,
            own_node(self._node),
            self._given.hostname,
            self._inbox.request_end,
            self._screen.set_level,
        )
        before = self._ros_node.register()
        self._ros_node.stay_registered(self._inbox.master_back)
        if before and not wait_until_gone(before, self._inbox.pause, _DISPLACED_S):
            raise Ending(
                Code.DONE if self._inbox.end_requested else Code.REFUSED,
                f"another runner {self._node} exists at this ROS master and does not end: "
                "end its launch, or give this one another name",
            )
        self._announce(runner_entry.own_entry(self._runner))
        self._announced = True

    def _announce(self, entry: runner_entry.RunnerEntry) -> None:
        self._entry = entry
        runner_entry.announce(self._master, self._node, entry)

    def _last_calls(self) -> Master:
        return Master(self._given.master_uri, own_node(self._node), _LAST_CALL_S)

    def _take(self) -> None:
        wanted = self._parameters.daemon
        socket = system_socket()
        why = f"~daemon is {wanted}"
        if wanted != "private":
            self._await_predecessor(socket)
        if wanted == "auto":
            choice = choose(socket, self._runner, self._given.master_uri, self._build_tree)
            wanted, why = ("system" if choice.system else "private"), choice.why
        if wanted == "private":
            log_file = self._given.log_file or f"{_log_folder()}/{self._runner}.log"
            log = Path(log_file.removesuffix(".log") + ".rtcfd.log")
            self._daemon = PrivateDaemon(program(self._build_tree), log)
            try:
                if not self._daemon.start(self._inbox.pause):
                    raise Ending(Code.DONE)
            except rtcf.RtcfError as error:
                raise Ending(Code.REFUSED, str(error)) from None
            socket = str(self._daemon.socket)
            self._screen.info(f"private daemon at {socket}, log in {self._daemon.log_file} ({why})")
        else:
            self._screen.info(f"system daemon at {socket} ({why})")
        self._screen.use_daemon(socket)
        self._client = rtcf.Client(socket)
        self._token = secrets.token_hex(8)
        self._hold()

    def _await_predecessor(self, socket: str) -> None:
        """Wait until rtcfd has ended the lease of a dead rt_runner of the same name."""
        deadline = time.monotonic() + _PREDECESSOR_S
        with rtcf.Client(socket) as client, contextlib.suppress(rtcf.RtcfError):
            while time.monotonic() < deadline:
                (status,) = client.get_status(self._runner).runners
                if not status.holder.startswith(f"rt_runner {self._node} ("):
                    return
                if self._inbox.pause(_RETRY_S):
                    raise Ending(Code.DONE)

    def _hold(self, attach: bool = False) -> None:
        assert self._client is not None
        self._lease = self._client.hold_runner(
            control_pb2.OpenHold(
                runner=self._runner,
                settings=self._parameters.settings,
                holder=f"rt_runner {self._node} (pid {os.getpid()})",
                token=self._token,
                attach=attach,
            )
        )
        self._inbox.read(self._lease)

    # -- the loop's life ----------------------------------------------------

    def _serve(self) -> Code:
        while True:
            event = self._inbox.get()
            if isinstance(event, EndRequest):
                if event.why:
                    self._screen.warn(f"asked to end: {event.why}")
                return Code.DONE
            if isinstance(event, MasterBack):
                self._come_back()
                continue
            if isinstance(event, LeaseLost):
                self._reconnect(event.error)
                continue
            kind = event.WhichOneof("kind")
            if kind == "taken":
                self._taken(event.taken)
            elif kind == "logs":
                self._screen.records(event.logs)
            elif kind == "report":
                self._report(event.report)
            elif kind == "ended":
                raise Ending(Code.LOST, event.ended.message)

    def _taken(self, status: Any) -> None:
        self._warmup_cycles = status.settings.warmup_cycles
        if self._lost_since is not None:
            self._lost_since = None
            self._screen.info("rtcfd is back, the runner is kept")
            return
        assert self._client is not None
        if self._parameters.graph:
            self._apply()  # before launchers load, since it unloads all other components
        self._announce(runner_entry.own_entry(self._runner, self._client.socket, self._token))
        self._taken_once = True
        threading.Thread(target=self._watch_loop, args=(self._client,), daemon=True).start()
        if self._parameters.mode == "wait_for_components":
            what = f"waiting for {self._parameters.components} components"
        elif self._parameters.mode == "wait_for_trigger":
            what = f"waiting for `rtcfctl -r {self._runner} start` or the service activate_rt_loop"
        else:
            what = "starting"
        self._screen.info(f"runner {self._runner} at {_shown(status.settings)}: {what}")
        if not self._parameters.settings.HasField("frequency_hz"):
            self._screen.warn("no ~frequency is set; RTCF 2021 took 1 Hz then")
        if self._parameters.mode == "no_wait":
            self._start()

    def _apply(self) -> None:
        """Load the components of ~graph."""
        assert self._client is not None
        try:
            result = self._client.apply(self._parameters.graph, self._runner)
        except rtcf.RefusedError as error:
            raise Ending(Code.REFUSED, f"~graph is rejected: {error}") from None
        for note in result.notes:
            self._screen.warn(note)

    def _come_back(self) -> None:
        """Write the entry again after a restart of the master, for launchers and tools."""
        with contextlib.suppress(MasterSilent):  # it has ended again
            self._announce(self._entry)
            self._screen.info("registered again at the ROS master")

    def _watch_loop(self, client: rtcf.Client) -> None:
        """Warn of each silence of a simulated clock, and of problems of the loop's node.  End when
        a ROS peer kills that node, which has the name in the launch file."""
        silent = False
        problem = ""
        while not self._over.wait(_CHECK_S):
            with contextlib.suppress(rtcf.RtcfError, ValueError):  # closed meanwhile
                (status,) = client.get_status(self._runner).runners
                if status.ros.killed:
                    self._inbox.request_end("a ROS node requested a shutdown")
                if status.clock_silence and not silent:
                    self._screen.warn(status.clock_silence)
                silent = bool(status.clock_silence)
                if status.ros.connected and status.ros.problem not in ("", problem):
                    problem = status.ros.problem
                    self._screen.warn(problem)

    def _report(self, report: control_pb2.HoldReport) -> None:
        if report.running and not self._was_running:
            self._screen.info(f"the loop runs with {report.components} components")
            self._say_status()
        elif self._was_running and not report.running:
            if not report.fault:
                self._screen.info("the loop is stopped")
            self._say_statistics()
        self._was_running = report.running
        if report.fault and report.fault != self._fault:
            if self._parameters.exit_on_fault:
                raise Ending(Code.FAILED, f"the loop has ended: {report.fault}")
            self._screen.error(f"the loop has ended: {report.fault}")
        self._fault = report.fault
        complete = report.components >= self._parameters.components
        # Start once each time the graph becomes complete: a loop stopped by a user stays stopped.
        due = self._parameters.mode == "wait_for_components" and complete and not self._complete
        self._complete = complete
        if due and not report.running:
            self._start()

    def _say_status(self) -> None:
        """Print the source of a simulated time, and warn of each missing prerequisite of real time
        once per launch."""
        assert self._client is not None
        with contextlib.suppress(rtcf.RtcfError):
            for runner in self._client.get_status(self._runner).runners:
                if runner.simulated:
                    self._screen.info("the loop follows /clock: its time is simulated")
                for reason in runner.degraded:
                    if reason not in self._said_missing:
                        self._screen.warn(f"!! {self._runner} IS NOT REAL TIME: {reason}")
                self._said_missing.update(runner.degraded)

    def _say_statistics(self) -> None:
        """Print statistics at the end of a loop, as RTCF 2021 does."""
        assert self._client is not None
        with contextlib.suppress(rtcf.RtcfError):
            for line in loop_statistics.lines(
                self._client.get_statistics(self._runner, timeout_s=_STATISTICS_S),
                self._warmup_cycles,
            ):
                self._screen.info(line)

    def _start(self) -> None:
        assert self._client is not None
        try:
            result = self._client.start(self._runner)
        except rtcf.RefusedError as error:
            raise Ending(Code.REFUSED, f"the loop does not start: {error}") from None
        for note in result.notes:  # _report() warns of missing prerequisites of real time
            self._screen.warn(note)

    def _reconnect(self, error: rtcf.RtcfError) -> None:
        if isinstance(error, ExpressionInvalidError) and self._falls_back(str(error)):
            self._hold()
            return
        if isinstance(error, rtcf.RefusedError):
            code = Code.REFUSED if self._lost_since is None else Code.LOST
            raise Ending(code, str(error))
        if self._daemon is not None:
            time.sleep(_RETRY_S)  # until the reason is in its log
            what = "has ended" if self._daemon.ended else f"does not answer ({error})"
            raise Ending(Code.LOST, f"the private rtcfd {what}: {self._daemon.last_words()}")
        now = time.monotonic()
        if not self._taken_once:
            raise Ending(Code.REFUSED, str(error))
        if self._lost_since is None:
            self._lost_since = now
            self._screen.warn(f"{error}; the loop continues; reconnecting")
        if now - self._lost_since > _RETURN_S:
            raise Ending(Code.LOST, str(error))
        if not self._inbox.pause(_RETRY_S):
            self._hold(attach=True)
        else:
            raise Ending(Code.DONE)

    def _falls_back(self, error: str) -> bool:
        """Replace an invalid expression by the default of RTCF 2021, with an error message."""
        ros = self._parameters.settings.ros
        for field, default in (("whitelist", ".*"), ("blacklist", "")):
            bad = getattr(ros, field)
            if f"{field}: bad regular expression '{bad}'" not in error or bad == default:
                continue
            self._screen.error(
                f"~ros_mapping_{field}: {error.partition(f'{field}: ')[2]}; "
                f"falling back to '{default}'"
            )
            setattr(ros, field, default)
            return True
        return False

    # -- the end ------------------------------------------------------------

    def _end(self) -> None:
        self._over.set()
        if self._announced:
            try:
                master = self._last_calls()
                found = runner_entry.find(master, self._node)
                if found is not None and found.pid == str(os.getpid()):
                    runner_entry.withdraw(master, self._node)
            except MasterSilent:
                pass
        if self._client is not None and self._was_running:
            self._say_statistics()
        if self._lease is not None and (self._daemon is None or not self._daemon.ended):
            self._give_back(self._lease)
        if self._daemon is not None:
            self._daemon.end()
        if self._client is not None:
            self._client.close()

    def _give_back(self, lease: rtcf.Lease) -> None:
        """End the lease; print log records of hooks until rtcfd has ended it."""
        lease.end()
        deadline = time.monotonic() + _END_S
        while (left := deadline - time.monotonic()) > 0:
            event = self._inbox.get(left)
            if isinstance(event, LeaseLost):
                return
            if hasattr(event, "WhichOneof"):
                kind = event.WhichOneof("kind")
                if kind == "logs":
                    self._screen.records(event.logs)
                elif kind == "ended":
                    return


def _shown(settings: runner_pb2.RunnerSettings) -> str:
    """Return the settings of the loop, including defaults, for people."""
    cpu = "a CPU with the fewest loops" if settings.cpu < 0 else f"CPU {settings.cpu}"
    return (
        f"{settings.frequency_hz:g} Hz, {cpu}, priority {settings.priority}, "
        f"overrun {word(runner_pb2.OverrunPolicy.DESCRIPTOR, settings.overrun)}"
    )


def _log_folder() -> str:
    """Return the log folder of ROS nodes that run without roslaunch."""
    home = os.environ.get("ROS_HOME") or os.path.expanduser("~/.ros")
    return os.environ.get("ROS_LOG_DIR") or f"{home}/log"


def own_node(runner_node: str) -> str:
    """Return the name of rt_runner's own node; the loop's node has the name in the launch file."""
    return f"{runner_node}/launch"


def runner_name(node: str) -> str:
    """Return the name of a node's runner: /arm/rt_runner is arm_rt_runner."""
    return re.sub(r"[^A-Za-z0-9_]", "_", node.strip("/"))


def main(argv: Sequence[str] | None = None, build_tree: Path | None = None) -> int:
    """Run rt_runner; return its exit status."""
    words = sys.argv[1:] if argv is None else argv
    if "-h" in words or "--help" in words:
        print(USAGE, end="")
        return Code.DONE
    try:
        given = arguments.parse(words, os.environ, "rt_runner")
    except ValueError as error:
        print(f"rt_runner: {error}", file=sys.stderr)
        return Code.USAGE
    if given.words:
        print(f"rt_runner: unexpected argument {given.words[0]}\n{USAGE}", file=sys.stderr, end="")
        return Code.USAGE
    return RunnerNode(given, build_tree).run()
