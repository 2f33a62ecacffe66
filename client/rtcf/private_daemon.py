"""A rtcfd of one's own: for the life of a launch or of a command, on a plain user's account.

It lives in a folder that only its user may enter, loads components from that
user's folders, keeps no state, and ends with who started it, however that ends.
"""

import contextlib
import os
import shutil
import socket
import struct
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO

from rtcf.errors import RtcfError

# Where builds put libraries of components, seen from the folder of a package or a workspace.
BUILT = ("build/lib/rtcf", "devel/lib/rtcf-components", "lib/rtcf")
_START_S = 30.0
_END_S = 3.5
_POLL_S = 0.02
_TAIL = 5  # lines
_CREDENTIALS = struct.Struct("3i")  # struct ucred: pid, uid, gid


def program(build_tree: Path | None) -> Path:
    """Return the rtcfd of the build tree, or the one that is installed."""
    return Path("/usr/bin/rtcfd") if build_tree is None else build_tree / "bin" / "rtcfd"


def component_folders(given: Sequence[Path] = ()) -> list[Path]:
    """Return the folders given, or those that a build has made here.  ValueError: there is none
    of that name."""
    for path in given:
        if not path.is_dir():
            raise ValueError(f"{path}: no such folder")
    candidates = given or [Path(each) for each in BUILT]
    return [path.absolute() for path in candidates if path.is_dir()]


def _sleep(seconds: float) -> bool:
    time.sleep(seconds)
    return False


class PrivateDaemon:
    """The process and its folder."""

    def __init__(
        self,
        program: Path,
        log_file: Path | None = None,
        options: Sequence[str] = (),
        socket: Path | None = None,
    ) -> None:
        """Make the folder.  Without `log_file` it logs to our standard error; `socket`: elsewhere
        than in the folder."""
        self._program = program
        self._options = options
        # Of XDG_RUNTIME_DIR it is certain that no other user enters it; mkdtemp sees to the rest.
        runtime = os.environ.get("XDG_RUNTIME_DIR")
        parent = runtime if runtime and os.access(runtime, os.W_OK) else None
        self._folder = Path(tempfile.mkdtemp(prefix="rtcf-", dir=parent))
        self.socket = socket or self._folder / "control.sock"
        self.log_file = log_file
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, pause: Callable[[float], bool] = _sleep) -> bool:
        """Start it and wait until it serves; return whether it does.

        `pause` waits for some seconds, and returns true if we are asked to end.  Raises RtcfError,
        also where another daemon serves the socket, which is left alone.
        """
        if not os.access(self._program, os.X_OK):
            raise RtcfError(f"no rtcfd at {self._program}: install it (apt install rtcfd)")
        self._check_owner()
        with self._open_log() as log:
            self._process = subprocess.Popen(
                [
                    *(str(self._program), "--foreground", "--end-with-stdin"),
                    *("--no-default-runner", "--socket", str(self.socket), *self._options),
                ],
                # It ends when this pipe does: with us.
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                # Ctrl-C is for us; we end it in order.
                start_new_session=True,
            )
        deadline = time.monotonic() + _START_S
        while not self._listens():
            if self.ended:
                raise RtcfError(f"rtcfd did not start: {self.last_words()}")
            if time.monotonic() > deadline:
                raise RtcfError(f"rtcfd does not serve {self.socket}")
            if pause(_POLL_S):
                return False
        return True

    def _check_owner(self) -> None:
        """Refuse the socket of another user, without connecting to it."""
        try:
            owner = self.socket.lstat().st_uid
        except OSError:
            return  # there is none, or rtcfd says why it cannot be made
        if owner != os.geteuid():
            raise RtcfError(
                f"{self.socket} belongs to another user (uid {owner}): choose another --socket"
            )

    def _listens(self) -> bool:
        """Tell whether the process that we started listens.  Another daemon at its socket is asked
        nothing: ours ends because of it, and says so."""
        # The file is there a moment before anybody listens.
        with socket.socket(socket.AF_UNIX) as probe, contextlib.suppress(OSError):
            probe.connect(str(self.socket))
            found = probe.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
            listener, _, _ = _CREDENTIALS.unpack(found)  # of the caller of listen(2), see unix(7)
            return self._process is not None and listener == self._process.pid
        return False

    def _open_log(self) -> IO[bytes]:
        if self.log_file is None:
            return os.fdopen(os.dup(2), "wb")
        try:
            self.log_file.parent.mkdir(parents=True, exist_ok=True)
            return self.log_file.open("wb")
        except OSError as error:
            raise RtcfError(f"cannot write rtcfd's log {self.log_file}: {error.strerror}") from None

    @property
    def ended(self) -> bool:
        """Tell whether it runs no more."""
        return self._process is None or self._process.poll() is not None

    def last_words(self) -> str:
        """Return the end of its log."""
        if self.log_file is None:
            return "its log says why"
        with contextlib.suppress(OSError):
            lines = self.log_file.read_text(errors="replace").splitlines()
            return "; ".join(lines[-_TAIL:])
        return "it has no log"

    def end(self) -> None:
        """End it, by force if it must be; remove its folder."""
        process = self._process
        if process is not None:
            # By its input alone: a signal would end one that has just begun without its own
            # cleaning up, and who waits for it here may be killed.
            if process.stdin is not None:
                process.stdin.close()
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                # Its executors follow: they stop without a rtcfd.
                process.kill()
                process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)
