"""The user's cache of compiled code: files named by a hash of everything that they depend on.

Only this user can read or write the folder. A damaged or missing file means that the code is
compiled again; nothing is kept if the disk is full. Files that were not used for the longest time
are removed when the folder is larger than its limit.
"""

import hashlib
import os
import stat
import time
from contextlib import suppress
from pathlib import Path

from rtcf_shared.folders import compiled_folder

LIMIT = 256 * 1024 * 1024  # bytes of all files
_KEPT = LIMIT * 3 // 4  # bytes that remain when old files are removed
_DIGEST = hashlib.sha256().digest_size
_DAY_NS = 86_400 * 10**9
_BETWEEN_NS = 600 * 10**9  # between two checks of the folder's size


class Cache:
    """Reads and writes the files of a folder."""

    def __init__(self, folder: Path) -> None:
        """Use a folder, which need not exist."""
        self._folder = folder
        self._is_usable: bool | None = None
        self._written = 0

    @staticmethod
    def folder_of_user() -> Path:
        """Return the folder of this user."""
        return compiled_folder() / ".functions"

    def read(self, key: str) -> bytes | None:
        """Return the content of a file; None if there is none, or if it is damaged."""
        if not self._usable():
            return None
        file = self._folder / key
        try:
            data = file.read_bytes()
        except OSError:
            return None
        content = data[_DIGEST:]
        if _checksum(key, content) != data[:_DIGEST]:
            with suppress(OSError):
                file.unlink()
            return None
        self._note_use(file)
        return content

    def write(self, key: str, content: bytes) -> None:
        """Write a file, atomically; do nothing if that is not possible."""
        if not self._usable():
            return
        part = self._folder / f".{key}.{os.getpid()}"
        try:
            descriptor = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o600)
            with open(descriptor, "wb") as file:
                file.write(_checksum(key, content) + content)
            part.replace(self._folder / key)
        except OSError:
            with suppress(OSError):
                part.unlink()
            self._is_usable = False  # the disk is full, for example
        else:
            self._written += len(content)

    def remove_old(self) -> None:
        """Remove the files that were not used for the longest time, if the folder is too large.

        Checks the size of the folder, of maybe 10000 files, at most once in ten minutes.
        """
        if not self._written or not self._usable() or not self._is_due():
            return
        files = []
        with suppress(OSError):
            for each in os.scandir(self._folder):
                with suppress(OSError):
                    found = each.stat(follow_symlinks=False)
                    files.append((found.st_mtime_ns, found.st_size, each.path))
        size = sum(each for _, each, _ in files)
        if size <= LIMIT:
            return
        for _, bytes_of_it, path in sorted(files):
            with suppress(OSError):
                os.unlink(path)
            size -= bytes_of_it
            if size <= _KEPT:
                return

    def _is_due(self) -> bool:
        """Tell whether the last check was ten minutes ago, and note the time of this one."""
        mark = self._folder.with_name(f"{self._folder.name}-checked")
        with suppress(OSError):
            if 0 <= time.time_ns() - mark.stat().st_mtime_ns < _BETWEEN_NS:
                return False
        with suppress(OSError):
            mark.touch(0o600)
        return True

    def _usable(self) -> bool:
        if self._is_usable is None:
            self._is_usable = self._prepare()
        return self._is_usable

    def _prepare(self) -> bool:
        """Create the folder; return False if others could change its content."""
        try:
            self._folder.parent.mkdir(parents=True, exist_ok=True)
            with suppress(FileExistsError):
                self._folder.mkdir(mode=0o700)
            found = self._folder.lstat()
        except OSError:
            return False
        is_own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
        return is_own and not found.st_mode & 0o077

    def _note_use(self, file: Path) -> None:
        """Set the time of a file, at most once a day."""
        with suppress(OSError):
            if file.stat().st_mtime_ns < time.time_ns() - _DAY_NS:
                os.utime(file)


def _checksum(key: str, content: bytes) -> bytes:
    return hashlib.sha256(key.encode() + content).digest()
