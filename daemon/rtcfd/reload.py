"""Reloads settings and graphs.d while rtcfd runs, and notices an upgrade of rtcfd.

Owned by the daemon.
"""

import contextlib
import logging
import os
from collections.abc import Callable, Iterable
from dataclasses import fields
from pathlib import Path

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, runner_pb2

from rtcfd.access.admission import Admission
from rtcfd.access.clients import Clients
from rtcfd.catalog.catalog import Catalog
from rtcfd.common import runner_settings
from rtcfd.common.background import WorkerThreads
from rtcfd.common.errors import RequestError, Unavailable
from rtcfd.configuration.options import Options
from rtcfd.operations.runner_core import SharedContext
from rtcfd.runners.runners import Runners
from rtcfd.state import handover
from rtcfd.state.boot_graphs import BootGraph, BootGraphs, become
from rtcfd.state.desired import Desired
from rtcfd.state.handover import Handover
from rtcfd.state.store import Store

log = logging.getLogger(__name__)

_USERS_TIMEOUT_S = 5.0
_FILES_TIMEOUT_S = 60.0
_COPY_TIMEOUT_S = 2.0
# Settings that take effect only at the start.
_FIXED = ("socket", "runtime_dir", "state_dir", "graphs_dir", "executor")


class Reloads:
    """Applies the settings and graphs.d to the parts of the daemon."""

    def __init__(
        self,
        given: Options,
        read_options: Callable[[], Options],
        shared: SharedContext,
        catalog: Catalog,
        runners: Runners,
        clients: Clients,
        admission: Admission,
        store: Store,
    ) -> None:
        self._given = given
        self._command_folder = shared.command.folder
        self._read_options = read_options
        self._shared = shared
        self._catalog = catalog
        self._runners = runners
        self._clients = clients
        self._admission = admission
        self._store = store
        self._asking_users = WorkerThreads("user database")
        self._reading = WorkerThreads("settings and graphs")
        self._copying = WorkerThreads("state folder")
        self._left: Handover | None = None  # from the previous rtcfd
        self._graphs = BootGraphs(given.graphs_dir, {}, self._settings_error)
        # Changed graphs of runners whose executors are adopted first.
        self._late: list[BootGraph] = []
        self._graph_problems: list[str] = []
        self._refused = ""  # the error of the last reload; empty = it succeeded
        self._files = (Path(__file__), given.executor)
        self._identities = [_identity(file) for file in self._files]

    def boot(self, states: list[Desired], running: Iterable[str]) -> list[Desired]:
        """Return the states, in which runners of graphs.d have the graphs of their files.

        The states of runners whose executors run stay; catch_up() changes them later.
        """
        adopted = set(running)
        if adopted and (left := handover.read(self._command_folder)):
            self._left = left
            before = runner_settings.merged(self._given.defaults, left.defaults)
            if not left.defaults.HasField("priority"):
                before.ClearField("priority")
            self._shared.defaults = before
            self._graphs = BootGraphs(self._given.graphs_dir, left.graphs, self._settings_error)
        graphs, self._graph_problems = self._graphs.read()
        found = {state.runner: state for state in states}
        for given in graphs:
            if given.runner in adopted:
                if self._left and given.changed:
                    self._late.append(given)
                continue
            state = found.setdefault(given.runner, Desired(given.runner))
            lines = become(state, given.graph)
            log.info("runner %s set up from %s", given.runner, given.file)
            if lines:
                state.replaced = (
                    f"{given.file} replaced changes by hand: {', '.join(lines)}: to keep such "
                    f"changes, write them to the file: `rtcfctl -r {given.runner} save FILE`"
                )
                log.warning("runner %s: %s", given.runner, state.replaced)
        return list(found.values())

    async def catch_up(self) -> None:
        """Apply changes of settings and graphs.d since the previous rtcfd read them.

        To be called after the adoption of executors.
        """
        lines = await self._follow_defaults(self._given.defaults)
        lines += await self._apply(self._late)
        self._late = []
        self._leave_note()
        for line in lines:
            log.info("changed while rtcfd was away: %s", line)

    async def rules(self) -> wire.AccessRules:
        """Return the access rules for executors."""
        access = self._admission.access
        try:
            return await self._asking_users.run(
                lambda: access.for_executors(self._given.socket), _USERS_TIMEOUT_S
            )
        except (RequestError, OSError) as problem:
            log.error("executors accept direct stops only from root and rtcfd's user: %s", problem)
            return wire.AccessRules()

    def notes(self) -> list[str]:
        """Return notes on rtcfd itself, a line each."""
        lines = [each for each in (self._given.settings.problem, self._refused) if each]
        lines += [f"not applied: {problem}" for problem in self._graph_problems]
        lines += self._store.problems
        if [_identity(file) for file in self._files] != self._identities:
            lines.insert(
                0,
                "restart pending: rtcfd was upgraded while it runs; `systemctl restart rtcfd` "
                "starts the new version, loops go on",
            )
        return lines

    @property
    def refused(self) -> list[str]:
        """The errors of graphs.d, a line each."""
        return list(self._graph_problems)

    async def reload(self) -> list[str]:
        """Reload settings and graphs.d; return a line for each change.

        Raises RequestError, without any change, if the settings are not valid.  One reload at a
        time; it goes on if its caller disconnects.
        """
        return await self._runners.operations.take_turn("a reload", self._reload, None)

    async def _reload(self) -> list[str]:
        self._shared.command.close_folders()
        try:
            lines = await self._read_again()
        except RequestError as error:
            self._refused = f"settings not reloaded: {error}"
            raise
        self._refused = ""
        return lines

    async def _read_again(self) -> list[str]:
        new = await self._reading.run(self._read_options, _FILES_TIMEOUT_S)
        with contextlib.suppress(Unavailable):  # a hanging disk must not delay the rest
            await self._copying.run(new.settings.keep, _COPY_TIMEOUT_S)
        lines = [
            f"{name} changes with the next restart of rtcfd"
            for name in _FIXED
            if getattr(new, name) != getattr(self._given, name)
        ]
        if new.limits.message_kb != self._given.limits.message_kb:
            lines.append("limits.message_kb changes with the next restart of rtcfd")
        for part in fields(new):
            if part.name in _WORDS and (getattr(new, part.name) != getattr(self._given, part.name)):
                lines.append(f"{_WORDS[part.name]} changed")
        self._catalog.folders = new.folders
        self._catalog.look_again()
        self._admission.access = new.access
        self._clients.limits = new.limits
        self._shared.limits = new.limits
        self._shared.rules = await self.rules()
        self._given = new
        # Also with unchanged settings, because the user database may have changed.
        for runner in self._runners.all():
            await runner.follow_limits()
        lines += await self._follow_defaults(new.defaults)
        graphs, self._graph_problems = await self._reading.run(self._graphs.read, _FILES_TIMEOUT_S)
        lines += self._graph_problems
        lines += await self._apply([given for given in graphs if given.changed])
        self._leave_note()
        log.log(
            logging.ERROR if self._graph_problems else logging.INFO,
            "settings and graphs reloaded: %s",
            "; ".join(lines) or "nothing has changed",
        )
        self._shared.events.add(
            control_pb2.Event.KIND_DAEMON, "; ".join(["settings reloaded", *lines])
        )
        return lines

    def _settings_error(self, settings: runner_pb2.RunnerSettings) -> str:
        return self._given.settings_error(settings)

    def _leave_note(self) -> None:
        handover.write(self._command_folder, Handover(self._shared.defaults, self._graphs.digests))

    async def _follow_defaults(self, new: runner_pb2.RunnerSettings) -> list[str]:
        before, self._shared.defaults = self._shared.defaults, new
        lines: list[str] = []
        for runner in self._runners.all():
            lines += await runner.follow_defaults(before)
        return lines

    async def _apply(self, graphs: Iterable[BootGraph]) -> list[str]:
        lines: list[str] = []
        for given in graphs:
            request = control_pb2.ApplyRequest(
                runner=given.runner,
                components=given.graph.components,
                settings=given.graph.settings,
            )
            try:
                result = await self._runners.apply(request, lambda line: None)
                lines.append(f"{given.file} applied; differences: {len(result.differences)}")
            except RequestError as error:
                problem = f"{given.file}: {error}"
                self._graph_problems.append(problem)
                self._graphs.forget(given.file)  # so that the next reload tries again
                log.error("%s", problem)
                lines.append(problem)
        return lines


_WORDS = {"folders": "component folders", "access": "access rights", "limits": "limits",
          "defaults": "defaults of runners"}  # fmt: skip


def _identity(file: Path) -> tuple[int, int] | None:
    """Return values that differ after a package manager has replaced a file."""
    try:
        found = os.stat(file)
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns
