"""The graphs of graphs.d: applied at boot, and again when a file changes.

Owned by the daemon (reload.py).  A file that is not valid is reported and left out as a
whole.
"""

import hashlib
import logging
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from rtcf.v1 import errors_pb2, runner_pb2
from rtcf_shared.errors import RtcfError
from rtcf_shared.graph_reader import Graph, read_graphs
from rtcf_shared.graph_writer import same_value

from rtcfd.common import regular_files, runner_settings
from rtcfd.common.declared_values import word
from rtcfd.common.errors import InvalidArgument, RequestError
from rtcfd.common.names import DEFAULT_RUNNER, check_base_name, check_graph, full_name
from rtcfd.state.desired import Desired

log = logging.getLogger(__name__)

_SUFFIXES = (".yaml", ".yml")


@dataclass
class BootGraph:
    """The graph of one runner, and its file."""

    file: Path
    graph: Graph
    changed: bool  # since the last read()

    @property
    def runner(self) -> str:
        """Return the runner's name."""
        return self.graph.runner or DEFAULT_RUNNER


class BootGraphs:
    """The folder graphs.d, and the digests of the files that were last read."""

    def __init__(
        self,
        folder: Path | None,
        applied: Mapping[str, str],
        settings_error: Callable[[runner_pb2.RunnerSettings], str] = lambda _: "",
    ) -> None:
        """`applied` has the digests of the previous rtcfd.

        `settings_error` returns why an executor would reject settings; empty = it accepts them.
        """
        self._folder = folder
        self._settings_error = settings_error
        self.digests = dict(applied)  # by file

    def read(self) -> tuple[list[BootGraph], list[str]]:
        """Return all graphs, and the errors, a line each."""
        graphs: list[BootGraph] = []
        problems: list[str] = []
        owners: dict[str, Path] = {}
        digests: dict[str, str] = {}
        for file in self._files(problems):
            try:
                text = regular_files.read_text(file)
                found = read_graphs(text, str(file))
                for graph in found:
                    self._check(graph)
            except OSError as error:
                problems.append(f"cannot read {file}: {error.strerror}")
                continue
            except UnicodeDecodeError:
                problems.append(f"{file}: it is not UTF-8 text")
                continue
            except RtcfError as error:
                problems.append(str(error))
                continue
            except RequestError as error:
                problems.append(f"{file}: {error}")
                continue
            digests[str(file)] = hashlib.sha256(text.encode()).hexdigest()
            changed = self.digests.get(str(file)) != digests[str(file)]
            for graph in found:
                given = BootGraph(file, graph, changed)
                first = owners.setdefault(given.runner, file)
                if first != file:
                    digests.pop(str(file), None)  # applied when the other file is gone
                    problems.append(f"{file}: runner {given.runner} is already in {first}")
                else:
                    graphs.append(given)
        self.digests = digests
        for problem in problems:
            log.error("%s", problem)
        return graphs, problems

    def forget(self, file: Path) -> None:
        """Make the next read() treat a file as changed."""
        self.digests.pop(str(file), None)

    def _check(self, graph: Graph) -> None:
        check_base_name("runner", graph.runner or DEFAULT_RUNNER)
        runner_settings.check(graph.settings)
        check_graph(graph.components)
        if graph.settings.ListFields() and (error := self._settings_error(graph.settings)):
            raise InvalidArgument(error, errors_pb2.REASON_VALUE_INVALID)

    def _files(self, problems: list[str]) -> Iterator[Path]:
        if self._folder is None:
            return
        try:
            regular_files.require_present(self._folder)
            files = sorted(self._folder.iterdir())
        except FileNotFoundError:
            return
        except OSError as error:
            problems.append(f"cannot read {self._folder}: {error.strerror}")
            return
        yield from (
            each for each in files if each.suffix in _SUFFIXES and not each.name.startswith(".")
        )


def become(desired: Desired, graph: Graph) -> list[str]:
    """Replace the graph and the settings of a desired state; quarantines and loop state stay.

    Returns a line for each earlier change by hand that this replaces.
    """
    lines = list(_replaced(desired, graph))
    quarantined = dict(desired.quarantined)
    desired.become(graph.components)
    desired.choose(graph.settings)
    for name, reason in quarantined.items():
        desired.quarantine(name, reason)
    return lines


def _replaced(desired: Desired, graph: Graph) -> Iterator[str]:
    yield from runner_settings.replaced(desired.chosen, graph.settings)
    specs = {full_name(spec): spec for spec in graph.components}
    for name, known in desired.components.items():
        spec = specs.get(name)
        if spec is None:
            if name not in desired.leased:
                yield f"{name} is removed"
            continue
        given = {each.name: each.value for each in spec.parameters}
        for each in known.parameters:
            if each.name not in given:
                if not spec.lists:  # else it may be the size of a vector
                    yield f"{name}.{each.name} {word(each.value)} -> its default"
            elif not same_value(each.value, given[each.name]):
                yield f"{name}.{each.name} {word(each.value)} -> {word(given[each.name])}"
