"""The settings of the service, and a copy of the last good settings.

A bad settings file must not keep rtcfd from supervising running loops: at its start,
rtcfd uses the copy in the state folder instead.
"""

import contextlib
import logging
from dataclasses import dataclass, field
from pathlib import Path

from rtcf_shared import whole_files

from rtcfd.common import regular_files
from rtcfd.common.errors import RequestError
from rtcfd.configuration import settings_file

log = logging.getLogger(__name__)

_NAME = "rtcfd.toml.last-good"
_NONE = "# Nothing was set.\n"


@dataclass(frozen=True)
class Settings:
    """The settings, and the error in the file if they are from the copy."""

    found: settings_file.Config = field(default_factory=settings_file.Config)
    problem: str = ""
    _copy: Path | None = None

    @staticmethod
    def read(
        file: Path | None,
        folder: Path | None,
        last_good: bool,
        settings_error: settings_file.SettingsError = lambda _: "",
        *,
        writable: bool = False,
    ) -> "Settings":
        """Read `file`, unless it is None; the copy is in `folder`.

        `settings_error` and `writable` are for settings_file.read.  Raises RequestError for a bad
        file; with `last_good`, only if there is no good copy either.
        """
        copy = folder / _NAME if folder else None
        if file is None:
            return Settings()
        try:
            return Settings(settings_file.read(file, settings_error, writable=writable), _copy=copy)
        except RequestError as error:
            if not last_good or copy is None or not _is_there(copy):
                raise
            return Settings(
                settings_file.read(copy), f"{error}; the last good settings are used instead"
            )

    @staticmethod
    def socket_in_bad(file: Path, folder: Path | None) -> Path | None:
        """Return the control socket that a bad file names; of a file that is no TOML, the one that
        the copy in `folder` names.  None = it names none."""
        for each in (file, folder / _NAME if folder else None):
            if each is not None:
                with contextlib.suppress(RequestError):
                    return settings_file.read_socket(each)
        return None

    def keep(self) -> None:
        """Write the copy, if these settings are good."""
        if self._copy is None or self.problem:
            return
        data = (self.found.text or _NONE).encode()
        with contextlib.suppress(OSError):
            if regular_files.read_bytes(self._copy) == data:
                return
        try:
            whole_files.replace(self._copy, data)
            whole_files.sync_folder(self._copy.parent)
        except OSError as error:
            log.warning("cannot copy the settings to %s: %s", self._copy, error.strerror)


def _is_there(copy: Path) -> bool:
    """Return whether there is a copy.

    An empty one does not count: a file system may leave it after a crash, and without rules
    every client would have all rights.
    """
    try:
        return copy.stat().st_size > 0
    except OSError:
        return False
