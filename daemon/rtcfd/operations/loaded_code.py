"""Which file each component's code was loaded from, and whether it is another one now.

Owned by a RunnerCore, for the executor that it has.  An executor keeps a copy
of its own, so a library that is rebuilt changes nothing until it is loaded again.
"""

import contextlib
import json
import os
from collections.abc import Iterable
from pathlib import Path

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2

from rtcfd.common.names import absolute, full_name

_Kinds = control_pb2.Difference
_Identity = tuple[int, int, int]  # inode, time of change, size


class LoadedCode:
    """The files, by component."""

    def __init__(self) -> None:
        self._files: dict[str, tuple[str, _Identity]] = {}

    def clear(self) -> None:
        """Forget all: the executor is new."""
        self._files = {}

    def before(self, request: wire.Request) -> dict[str, _Identity]:
        """Look at the libraries of a change that is about to be asked for."""
        return {path: found for path in _libraries(request) if (found := _identity(path))}

    def after(
        self,
        request: wire.Request,
        change: control_pb2.ChangeResult,
        seen: dict[str, _Identity],
    ) -> None:
        """Note what a change has loaded; `seen` is what before() gave."""
        kind = request.WhichOneof("kind")
        if kind == "load":
            self._note(change.component, request.load.library, seen)
        elif kind == "replace":
            self._files.pop(absolute(request.replace.component), None)
            self._note(change.component, request.replace.library, seen)
        elif kind == "unload":
            for name in request.unload.components:
                self._files.pop(absolute(name), None)
        elif kind == "apply" and not request.apply.dry_run:
            libraries = {full_name(each.component): each.library for each in
                         request.apply.components}  # fmt: skip
            for each in change.differences:
                if each.kind in (_Kinds.KIND_LOAD, _Kinds.KIND_REPLACE):
                    self._note(each.component, libraries.get(each.component, ""), seen)
                elif each.kind == _Kinds.KIND_UNLOAD:
                    self._files.pop(each.component, None)

    def _note(self, name: str, path: str, seen: dict[str, _Identity]) -> None:
        if path in seen:
            self._files[name] = (path, seen[path])

    def changed(self) -> dict[str, str]:
        """Return the components whose library is another file now, and its path.

        Looks at files: for a thread beside the event loop.
        """
        now = {path: _identity(path) for path in {path for path, _ in self._files.values()}}
        return {name: path for name, (path, then) in self._files.items() if now[path] != then}

    def store(self, file: Path) -> None:
        """Leave it to the next rtcfd, that adopts the executor."""
        with contextlib.suppress(OSError):  # then that one does not know
            file.write_text(json.dumps(self._files), encoding="utf-8")

    def restore(self, file: Path) -> None:
        """Take what the rtcfd before this one left."""
        self._files = {}
        with contextlib.suppress(OSError, ValueError, TypeError):
            found = json.loads(file.read_text(encoding="utf-8"))
            self._files = {
                str(name): (str(path), (int(then[0]), int(then[1]), int(then[2])))
                for name, (path, then) in found.items()
            }
        with contextlib.suppress(OSError):
            file.unlink()


def _libraries(request: wire.Request) -> Iterable[str]:
    kind = request.WhichOneof("kind")
    if kind in ("load", "replace"):
        return [getattr(request, kind).library]
    if kind == "apply":
        return {each.library for each in request.apply.components}
    return []


def _identity(path: str) -> _Identity | None:
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size
