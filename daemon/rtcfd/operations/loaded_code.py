"""The library of each component, and whether its file has changed since it was loaded.

Owned by a RunnerCore, for its current executor.  An executor runs a private copy of a
library, so a rebuilt library takes effect only when it is loaded again.
"""

import contextlib
import json
import os
from collections.abc import Iterable
from pathlib import Path

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2
from rtcf_shared import whole_files

from rtcfd.common import regular_files
from rtcfd.common.background import WorkerThreads
from rtcfd.common.errors import Unavailable
from rtcfd.common.names import absolute, full_name
from rtcfd.common.regular_files import PARSE_ERRORS

_Kinds = control_pb2.Difference
_Identity = tuple[int, int, int]  # inode, modification time, size
_TIMEOUT_S = 2.0  # for a folder, which may be remote


class LoadedCode:
    """The library files, by component.  A file is unknown if its folder does not answer."""

    def __init__(self, folders: WorkerThreads) -> None:
        self._folders = folders
        self._files: dict[str, tuple[str, _Identity]] = {}

    def clear(self) -> None:
        """Forget all files, for a new executor."""
        self._files = {}

    async def before(self, request: wire.Request) -> dict[str, _Identity]:
        """Return the identities of a change's libraries, before it is requested.

        Returns at once if the change has no libraries.
        """
        found = await self._look(set(_libraries(request)))
        return {path: identity for path, identity in found.items() if identity is not None}

    def after(
        self,
        request: wire.Request,
        change: control_pb2.ChangeResult,
        seen: dict[str, _Identity],
    ) -> None:
        """Note the libraries that a change has loaded; `seen` is the result of before()."""
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
        else:
            self._files.pop(name, None)

    def files(self) -> dict[str, tuple[str, int, int, int]]:
        """Return the library of each component when it was loaded: path, inode, modification
        time, size."""
        return {name: (path, *identity) for name, (path, identity) in self._files.items()}

    async def changed(self) -> dict[str, str]:
        """Return the components whose library has changed, each with the library's path."""
        files = dict(self._files)
        now = await self._look({path for path, _ in files.values()})
        return {
            name: path for name, (path, then) in files.items() if path in now and now[path] != then
        }

    async def _look(self, paths: set[str]) -> dict[str, _Identity | None]:
        """Return the identities of files, read in a thread; empty if a folder does not answer."""
        if not paths:
            return {}
        try:
            return await self._folders.run(
                lambda: {path: _identity(path) for path in paths}, _TIMEOUT_S
            )
        except Unavailable:
            return {}

    def store(self, file: Path) -> None:
        """Save the files for the next rtcfd, which adopts the executor."""
        with contextlib.suppress(OSError):  # the next rtcfd then does not know them
            whole_files.replace(file, json.dumps(self._files).encode(), sync=False, mode=0o600)

    def restore(self, file: Path) -> None:
        """Load the files that the previous rtcfd saved."""
        self._files = {}
        with contextlib.suppress(OSError, *PARSE_ERRORS):
            found = json.loads(regular_files.read_bytes(file))
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
