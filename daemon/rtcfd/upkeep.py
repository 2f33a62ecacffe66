"""What changes in rtcfd itself while it runs: its settings, its graphs.d, its own files.

Owned by the daemon.
"""

import logging
import os
from collections.abc import Callable, Iterable
from dataclasses import fields
from pathlib import Path

from rtcf.v1 import control_pb2

from rtcfd.boot_graphs import BootGraphs, become
from rtcfd.catalog import Catalog
from rtcfd.desired import Desired
from rtcfd.errors import Refusal
from rtcfd.front import Front
from rtcfd.gate import Gate
from rtcfd.options import Options
from rtcfd.runner import Surroundings
from rtcfd.runners import Runners

log = logging.getLogger(__name__)

# Read at the start only.
_FIXED = ("socket", "runtime_dir", "state_dir", "graphs_dir", "executor")


class Upkeep:
    """Keeps the parts of the daemon as the settings say."""

    def __init__(
        self,
        given: Options,
        read_options: Callable[[], Options],
        shared: Surroundings,
        catalog: Catalog,
        runners: Runners,
        front: Front,
        gate: Gate,
    ) -> None:
        self._given = given
        self._read_options = read_options
        self._shared = shared
        self._catalog = catalog
        self._runners = runners
        self._front = front
        self._gate = gate
        self._graphs = BootGraphs(given.graphs_dir)
        self._graph_problems: list[str] = []
        self._files = (Path(__file__), given.executor)
        self._identities = [_identity(file) for file in self._files]

    def boot(self, states: list[Desired], running: Iterable[str]) -> list[Desired]:
        """Return the states with the runners of graphs.d as their files say, but for those whose
        executors run."""
        graphs, self._graph_problems = self._graphs.read()
        found = {state.runner: state for state in states}
        adopted = set(running)
        for given in graphs:
            if given.runner in adopted:
                continue
            become(found.setdefault(given.runner, Desired(given.runner)), given.graph)
            log.info("runner %s is as %s says", given.runner, given.file)
        return list(found.values())

    def notes(self) -> list[str]:
        """Return what is to be said about rtcfd itself."""
        lines = [f"not applied: {problem}" for problem in self._graph_problems]
        if [_identity(file) for file in self._files] != self._identities:
            lines.insert(
                0,
                "restart pending: rtcfd was upgraded while it runs; `systemctl restart rtcfd` "
                "stops the loops and starts the new version",
            )
        return lines

    async def reload(self) -> list[str]:
        """Read settings and graphs.d again; refused as a whole if the settings are not valid."""
        new = self._read_options()
        lines = [
            f"{name} changes with the next restart of rtcfd"
            for name in _FIXED
            if getattr(new, name) != getattr(self._given, name)
        ]
        if new.limits.message_kb != self._given.limits.message_kb:
            lines.append("limits.message_kb changes with the next restart of rtcfd")
        for part in fields(new):
            if part.name in ("folders", "access", "limits", "defaults") and (
                getattr(new, part.name) != getattr(self._given, part.name)
            ):
                lines.append(f"{_WORDS[part.name]} changed")
        self._catalog.folders = new.folders
        self._gate.access = new.access
        self._front.limit = new.limits.clients
        self._shared.limits = new.limits
        before, self._shared.defaults = self._shared.defaults, new.defaults
        self._given = new
        for runner in self._runners.all():
            lines += await runner.follow_defaults(before)
        lines += await self._reload_graphs()
        log.info("settings and graphs read again: %s", "; ".join(lines) or "nothing has changed")
        return lines

    async def _reload_graphs(self) -> list[str]:
        graphs, self._graph_problems = self._graphs.read()
        lines = list(self._graph_problems)
        for given in graphs:
            if not given.changed:
                continue
            request = control_pb2.ApplyRequest(
                runner=given.runner,
                components=given.graph.components,
                settings=given.graph.settings,
            )
            try:
                result = await self._runners.apply(request, lambda line: None)
                lines.append(f"{given.file}: {len(result.differences)} differences applied")
            except Refusal as refusal:
                problem = f"{given.file}: {refusal}"
                self._graph_problems.append(problem)
                log.error("%s", problem)
                lines.append(problem)
        return lines


_WORDS = {"folders": "component folders", "access": "access rights", "limits": "limits",
          "defaults": "defaults of runners"}  # fmt: skip


def _identity(file: Path) -> tuple[int, int] | None:
    """Return what is another when a package manager has replaced a file."""
    try:
        found = os.stat(file)
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns
