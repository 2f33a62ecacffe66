"""The settings of the service, and a copy of those that were good last.

A file that cannot be read must not keep rtcfd from supervising loops that run:
at a start, the copy in the state folder is taken in its place.
"""

import contextlib
import logging
from dataclasses import dataclass, field
from pathlib import Path

from rtcf_shared import durable

from rtcfd.common import regular_files
from rtcfd.common.refusals import Refusal
from rtcfd.configuration import settings_file

log = logging.getLogger(__name__)

_NAME = "rtcfd.toml.last-good"
_NONE = "# Nothing was set.\n"


@dataclass(frozen=True)
class Settings:
    """What was read, and what was wrong with the file if the copy was taken."""

    found: settings_file.Config = field(default_factory=settings_file.Config)
    problem: str = ""
    _copy: Path | None = None

    @staticmethod
    def read(
        file: Path | None,
        folder: Path | None,
        last_good: bool,
        opinion: settings_file.Opinion = lambda _: "",
    ) -> "Settings":
        """Read a file, if one is given; `folder` is that of the copy.

        Raises Refusal, with `last_good` only if there is no good copy either.
        """
        copy = folder / _NAME if folder else None
        if file is None:
            return Settings()
        try:
            return Settings(settings_file.read(file, opinion), _copy=copy)
        except Refusal as refusal:
            if not last_good or copy is None or not _is_there(copy):
                raise
            return Settings(
                settings_file.read(copy), f"{refusal}; the last good settings are taken instead"
            )

    def keep(self) -> None:
        """Make a copy of settings that were good."""
        if self._copy is None or self.problem:
            return
        data = (self.found.text or _NONE).encode()
        with contextlib.suppress(OSError):
            if regular_files.read_bytes(self._copy) == data:
                return
        try:
            durable.replace(self._copy, data)
            durable.sync_folder(self._copy.parent)
        except OSError as error:
            log.warning("no copy of the settings at %s: %s", self._copy, error.strerror)


def _is_there(copy: Path) -> bool:
    """Tell whether there is a copy; an empty one is what a file system left of it, and would
    grant everybody everything."""
    try:
        return copy.stat().st_size > 0
    except OSError:
        return False
