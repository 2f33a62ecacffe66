"""A file that redirects a browser to the page.

The browser gets the file's name as argument, not the address with the token, because all users can
see the arguments of a command.
"""

import contextlib
import html
import os
import shutil
import tempfile
from pathlib import Path

_PAGE = """<!doctype html>
<meta charset="utf-8">
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0;url={address}">
<title>rtcf scope</title>
<p><a href="{address}">the scope</a></p>
"""


class Redirect:
    """One HTML file that only its user can read."""

    def __init__(self, address: str) -> None:
        """Create the file in a temporary folder; raises OSError."""
        self._folder = Path(tempfile.mkdtemp(prefix="rtcf-scope-", dir=_runtime_folder()))
        self.file = self._folder / "open.html"
        descriptor = os.open(self.file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with open(descriptor, "w", encoding="utf-8") as file:
            file.write(_PAGE.format(address=html.escape(address)))

    def remove(self) -> None:
        """Remove the file and its folder."""
        with contextlib.suppress(OSError):
            shutil.rmtree(self._folder)


def _runtime_folder() -> str | None:
    """Return $XDG_RUNTIME_DIR if only the user can access it; None selects /tmp."""
    folder = os.environ.get("XDG_RUNTIME_DIR", "")
    try:
        found = os.stat(folder)
    except OSError:
        return None
    return folder if found.st_uid == os.getuid() and not found.st_mode & 0o077 else None
