"""Layouts of the page that somebody has saved, a file each."""

import json
import re
from pathlib import Path
from typing import Any

from rtcf_shared import durable

MOST_BYTES = 64 * 1024
MOST = 200
_NAME = re.compile(r"[\w][\w .-]{0,63}")


class LayoutError(ValueError):
    """A layout that is not there, or cannot be; says why."""


class Layouts:
    """Those of one folder, which is made when it is needed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def names(self) -> list[str]:
        """Return those there are."""
        return sorted(file.stem for file in self._folder.glob("*.json"))

    def read(self, name: str) -> Any:
        """Return one; raises LayoutError."""
        try:
            return json.loads(self._file(name).read_text())
        except FileNotFoundError:
            raise LayoutError(f"no layout {name}") from None
        except (OSError, ValueError) as error:
            raise LayoutError(f"layout {name}: {error}") from None

    def write(self, name: str, text: str) -> None:
        """Save one over another of its name; raises LayoutError."""
        file = self._file(name)
        if len(text.encode()) > MOST_BYTES:
            raise LayoutError(f"a layout has {MOST_BYTES} bytes at most")
        try:
            json.loads(text)
        except ValueError as error:
            raise LayoutError(f"layout {name} is no JSON: {error}") from None
        except RecursionError:
            raise LayoutError(f"layout {name} is nested too deeply") from None
        try:
            if not file.exists() and len(self.names()) >= MOST:
                raise LayoutError(f"there are {MOST} layouts: remove some")
            self._folder.mkdir(parents=True, exist_ok=True)
            durable.replace(file, text.encode())
        except OSError as error:
            raise LayoutError(f"layout {name} is not saved: {error.strerror}") from None

    def remove(self, name: str) -> None:
        """Remove one; raises LayoutError."""
        try:
            self._file(name).unlink()
        except OSError as error:
            raise LayoutError(f"layout {name} is not removed: {error.strerror}") from None

    def _file(self, name: str) -> Path:
        if not _NAME.fullmatch(name):
            raise LayoutError(f"{name!r}: a layout's name is of letters, digits, space, . - and _")
        return self._folder / f"{name}.json"
