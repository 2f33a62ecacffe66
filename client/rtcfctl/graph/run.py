"""`rtcfctl run`: runs a loop in a private daemon until Ctrl-C.

It reloads saved files and rebuilt libraries; the daemon logs to the standard error of rtcfctl.
"""

import argparse
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import rtcf
from rtcf.client import DEFAULT_RUNNER
from rtcf.private_daemon import BUILT, PrivateDaemon, component_folders, program
from rtcf.v1 import graph_pb2

from rtcfctl.graph import files, python_source
from rtcfctl.graph.compiler import Compiler
from rtcfctl.terminal.interruption import interrupted_by_termination
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import counted

_POLL_S = 0.5


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    run = verbs.add_parser(
        "run", parents=[common], help="run a loop in a private daemon until Ctrl-C, for development"
    )
    run.add_argument("file", metavar="FILE", help="graph file, or FILE.py with a component")
    run.add_argument("type", metavar="CLASS", nargs="?", help="component class in FILE.py")
    run.add_argument(
        "--path", action="append", default=[], metavar="FOLDER", type=Path,
        help=f"search libraries in this folder (default: {', '.join(BUILT)}, if they exist)",
    )  # fmt: skip
    run.add_argument("--no-start", action="store_true", help="do not start the loop")
    python_source.add_option(run)
    run.set_defaults(run=show)


def show(_: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Run the loop until Ctrl-C.  Raises ValueError, and RtcfError if the daemon ends."""
    if python_source.is_source(args.file) != bool(args.type):
        raise ValueError("run: specify a graph file, or FILE.py and CLASS")
    with ExitStack() as ends:
        compiler = None
        if args.type:
            compiler = ends.enter_context(python_source.warm_compiler(args.build_tree))
        _run(args, _Source(args, output, compiler), output)


def _run(args: argparse.Namespace, source: "_Source", output: Output) -> None:
    graphs = source.read()  # report errors in the file before the daemon starts
    try:
        folders = component_folders(args.path)
    except ValueError as error:
        raise ValueError(f"--path {error}") from None
    with interrupted_by_termination():
        daemon = PrivateDaemon(
            program(args.build_tree),
            options=[word for path in folders for word in ("--path", str(path))],
            socket=Path(args.socket) if args.socket else None,
        )
        try:
            daemon.start()
            with rtcf.Client(daemon.socket) as client:
                runners = source.apply(client, graphs)
                for runner in [] if args.no_start else runners:
                    client.start(runner, output.progress)
                _say(f"{'stopped' if args.no_start else 'running'}; Ctrl-C ends it")
                _say(f"from another terminal: rtcfctl --socket {daemon.socket} status")
                while not daemon.ended:
                    time.sleep(_POLL_S)
                    source.reload(client)
            raise rtcf.RtcfError("rtcfd has ended: see above")
        except KeyboardInterrupt:
            return
        finally:
            daemon.end()


def _say(line: str) -> None:
    print(line, flush=True)


def _full_name(spec: graph_pb2.ComponentSpec) -> str:
    parts = [part for part in spec.ns.split("/") if part]
    return "/" + "/".join([*parts, spec.name or spec.type])


class _Source:
    """The graph file or Python source, its last applied version, and the last reported error."""

    def __init__(self, args: argparse.Namespace, output: Output, compiler: Compiler | None) -> None:
        self._args = args
        self._output = output
        self._compiler = compiler
        source = Path(args.file).resolve()
        self._changes = python_source.SourceChanges(source) if args.type else None
        self._last = self._content()
        self._refused = ""
        # The specs of the file when it was last applied, by runner and full name.
        self._given: dict[str, dict[str, graph_pb2.ComponentSpec]] = {}

    def read(self) -> list[rtcf.Graph]:
        """Return the graphs of the file's present content.  Raises RtcfError."""
        file = self._args.file
        if self._args.type:
            package = python_source.compiled(
                file, self._args.build_tree, self._output.begin, not self._args.no_verify,
                self._compiler,
            )  # fmt: skip
            spec = rtcf.component(package, self._args.type)
            return [rtcf.Graph(self._args.runner or DEFAULT_RUNNER, components=[spec])]
        graphs = rtcf.read_graphs(*files.read(file))
        for graph in graphs:
            graph.runner = graph.runner or self._args.runner or DEFAULT_RUNNER
        return graphs

    def apply(self, client: rtcf.Client, graphs: list[rtcf.Graph]) -> list[str]:
        """Apply the graphs with the present files of libraries; return the names of the runners."""
        known = {str(each.runner) for each in client.get_status().runners}
        names = []
        for graph in graphs:
            if graph.runner not in known:
                client.add_runner(graph.runner)
            result = client.apply(
                graph.components, graph.runner, graph.settings,
                on_progress=self._output.progress, rebuilt=True,
                given_before=self._given.get(graph.runner, {}).values(),
            )  # fmt: skip
            self._given[graph.runner] = {_full_name(each): each for each in graph.components}
            self._output.notes(result.notes)
            names.append(graph.runner)
        return names

    def reload(self, client: rtcf.Client) -> None:
        """Apply a saved file or rebuilt libraries.  Print an error once; the loop continues."""
        content = self._content()
        try:
            rebuilt = [
                (str(status.runner), str(each.full_name))
                for status in client.get_status().runners
                for each in client.list_components(status.runner)
                if each.library_changed
            ]
            if content != self._last:
                self.apply(client, self.read())
            elif rebuilt:
                # Replace only the components of rebuilt libraries.
                for runner, name in rebuilt:
                    given = self._given.get(runner, {}).get(name)
                    result = client.replace(
                        name, given or graph_pb2.ComponentSpec(), runner, self._output.progress,
                        given_before=given,
                    )  # fmt: skip
                    self._output.notes(result.notes)
            else:
                return
        except (rtcf.RefusedError, rtcf.GraphFileError, python_source.NotCompiledError) as error:
            # The file may be incomplete because it is being written: report only an error that
            # occurs twice in a row.
            said = f"{content!r} {error}"
            if said == self._refused or isinstance(error, python_source.NotCompiledError):
                self._last = content
                self._output.error(error)
            self._refused = said
            return
        self._refused = ""
        what = f"{counted(len(rebuilt), 'component')} of rebuilt libraries"
        _say(f"reloaded {what if content == self._last else self._args.file}")
        self._last = content

    def _content(self) -> object:
        """Return a value that changes with the file's content; None if there is no file."""
        if self._changes is not None:
            self._changes.found()
            return self._changes.fingerprint
        try:
            status = Path(self._args.file).stat()
        except OSError:
            return None
        return (status.st_ino, status.st_size, status.st_mtime_ns)
