"""A private rtcfd for one launch or command, under an ordinary user account.

Its folder is accessible only to its user.  It loads components from that user's folders, keeps
incidents until its end but no other state, and ends with the process that started it, even if that
process is killed.
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

# Folders of component libraries below a package or a workspace.
BUILT = ("build/lib/rtcf", "devel/lib/rtcf-components", "lib/rtcf")
_START_S = 30.0
_END_S = 3.5
_POLL_S = 0.02
_TAIL = 5  # lines
_CREDENTIALS = struct.Struct("3i")  # struct ucred: pid, uid, gid


def program(build_tree: Path | None) -> Path:
    """Return the path of the rtcfd of a build tree, or of the installed one."""
    return Path("/usr/bin/rtcfd") if build_tree is None else build_tree / "bin" / "rtcfd"


def component_folders(given: Sequence[Path] = ()) -> list[Path]:
    """Return `given` as absolute paths, by default the build folders below the current folder.

    Raises ValueError if one of `given` is not a folder.
    """
    for path in given:
        if not path.is_dir():
            raise ValueError(f"{path}: no such folder")
    candidates = given or [Path(each) for each in BUILT]
    return [path.absolute() for path in candidates if path.is_dir()]


def _sleep(seconds: float) -> bool:
    time.sleep(seconds)
    return False


def _new_folder() -> Path:
    # Other users cannot access XDG_RUNTIME_DIR, nor a folder of mkdtemp.
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    parent = runtime if runtime and os.access(runtime, os.W_OK) else None
    return Path(tempfile.mkdtemp(prefix="rtcf-", dir=parent))


class PrivateDaemon:
    """The process of a private rtcfd, and its folder."""

    def __init__(
        self,
        program: Path,
        log_file: Path | None = None,
        options: Sequence[str] = (),
        socket: Path | None = None,
    ) -> None:
        """Create the folder, unless `socket` is given, which is by default in the folder.

        Without `log_file`, rtcfd logs to this process's standard error.  `options` are further
        options of rtcfd.
        """
        self._program = program
        self._options = options
        self._folder: Path | None = None
        if socket is None:
            self._folder = _new_folder()
            socket = self._folder / "control.sock"
        self.socket = socket
        self.log_file = log_file
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, pause: Callable[[float], bool] = _sleep) -> bool:
        """Start rtcfd and wait until it listens; return whether it does.

        `pause` waits for some seconds and returns true to cancel.  Raises RtcfError, also if
        another daemon listens on the socket; that daemon is not affected.
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
                # rtcfd ends at the end of this pipe, thus with this process.
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                # Ctrl-C reaches only this process, which then ends rtcfd in order.
                start_new_session=True,
            )
        deadline = time.monotonic() + _START_S
        while not self._listens():
            if self.ended:
                raise RtcfError(f"rtcfd did not start: {self.last_words()}")
            if time.monotonic() > deadline:
                raise RtcfError(f"rtcfd does not listen on {self.socket}")
            if pause(_POLL_S):
                return False
        return True

    def _check_owner(self) -> None:
        """Raise RtcfError if another user owns the socket, without connecting to it."""
        try:
            owner = self.socket.lstat().st_uid
        except OSError:
            return  # rtcfd creates it, or reports why it cannot
        if owner != os.geteuid():
            raise RtcfError(
                f"{self.socket} belongs to another user (uid {owner}): choose another --socket"
            )

    def _listens(self) -> bool:
        """Return whether the started process listens, and not another daemon.

        If another daemon listens, the started process ends with an error.
        """
        # The socket exists slightly before rtcfd listens.
        with socket.socket(socket.AF_UNIX) as probe, contextlib.suppress(OSError):
            probe.connect(str(self.socket))
            found = probe.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
            listener, _, _ = _CREDENTIALS.unpack(found)  # the caller of listen(2), see unix(7)
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
        """Whether the process has ended, or was not started."""
        return self._process is None or self._process.poll() is not None

    def last_words(self) -> str:
        """Return the last lines of its log, for an error message."""
        if self.log_file is None:
            return "see its log"
        with contextlib.suppress(OSError):
            lines = self.log_file.read_text(errors="replace").splitlines()
            return "; ".join(lines[-_TAIL:])
        return "it has no log"

    def end(self) -> None:
        """End the process, by SIGKILL after a timeout, and remove its folder."""
        process = self._process
        if process is not None:
            # Not by a signal, which would end a starting rtcfd without its clean-up. Closing the
            # pipe also works if this process is killed while it waits.
            if process.stdin is not None:
                process.stdin.close()
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                # Its executors stop, too, without rtcfd.
                process.kill()
                process.wait()
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
