"""Saved layouts of the page, one file each."""

import json
import re
from pathlib import Path
from typing import Any

from rtcf_shared import whole_files

MOST_BYTES = 64 * 1024
MOST = 200
_NAME = re.compile(r"[\w][\w .-]{0,63}")


class LayoutError(ValueError):
    """A layout does not exist, is invalid, or cannot be saved or removed."""


class Layouts:
    """The layouts of one folder, which the first `write` creates."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def names(self) -> list[str]:
        """Return the names of all layouts, sorted."""
        return sorted(file.stem for file in self._folder.glob("*.json"))

    def read(self, name: str) -> Any:
        """Return a layout as parsed JSON; raises LayoutError."""
        try:
            return json.loads(self._file(name).read_text())
        except FileNotFoundError:
            raise LayoutError(f"no layout {name}") from None
        except (OSError, ValueError) as error:
            raise LayoutError(f"layout {name}: {error}") from None

    def write(self, name: str, text: str) -> None:
        """Save a layout, the JSON text, replacing one of the same name; raises LayoutError."""
        file = self._file(name)
        if len(text.encode()) > MOST_BYTES:
            raise LayoutError(f"a layout can have at most {MOST_BYTES} bytes")
        try:
            json.loads(text)
        except ValueError as error:
            raise LayoutError(f"layout {name} is not JSON: {error}") from None
        except RecursionError:
            raise LayoutError(f"layout {name} is nested too deeply") from None
        try:
            if not file.exists() and len(self.names()) >= MOST:
                raise LayoutError(f"limit of {MOST} layouts reached: remove some")
            self._folder.mkdir(parents=True, exist_ok=True)
            whole_files.replace(file, text.encode())
        except OSError as error:
            raise LayoutError(f"cannot save layout {name}: {error.strerror}") from None

    def remove(self, name: str) -> None:
        """Remove a layout; raises LayoutError."""
        try:
            self._file(name).unlink()
        except OSError as error:
            raise LayoutError(f"cannot remove layout {name}: {error.strerror}") from None

    def _file(self, name: str) -> Path:
        if not _NAME.fullmatch(name):
            raise LayoutError(f"layout name {name!r}: use letters, digits, space, . - and _")
        return self._folder / f"{name}.json"
