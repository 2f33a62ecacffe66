"""A process that runs a component and is killed after too long without output.

It writes each stage to standard output before the stage begins, and reports to standard error.
"""

import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from typing import IO

# For one hook or some updates; a longer one would stop a real loop.
HANG_S = 10.0
# Within a report: looking up its source lines can take long.
_REPORT_S = 120.0
_POLL_S = 0.05
_BEGIN, _END = "==ERROR: RealtimeSanitizer: ", "SUMMARY: "


class Watched:
    """The process; owned by the caller of wait()."""

    def __init__(self, command: Sequence[str], environment: Mapping[str, str]) -> None:
        self.stage = ""  # the present stage
        self.errors: list[str] = []  # lines of standard error
        self.hang = ""  # a message if the component did not return
        self._heard = time.monotonic()
        self._reporting = False
        self._process = subprocess.Popen(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
        assert self._process.stdout is not None and self._process.stderr is not None
        self._readers = [
            threading.Thread(target=self._read_stages, args=(self._process.stdout,)),
            threading.Thread(target=self._read_errors, args=(self._process.stderr,)),
        ]

    def wait(self, hang_s: float = HANG_S) -> int:
        """Wait for the end of the process; return its exit status, negative for a signal.

        The process is killed after `hang_s` without output.
        """
        for reader in self._readers:
            reader.start()
        try:
            while self._process.poll() is None:
                limit = _REPORT_S if self._reporting else hang_s
                if time.monotonic() - self._heard > limit:
                    self.hang = (
                        f"the component does not return: no progress for {limit:g} s while "
                        f"{self.stage or 'loading'}"
                    )
                    self._process.kill()
                    break
                time.sleep(_POLL_S)
        finally:
            self._process.kill()
            self._process.wait()
        for reader in self._readers:
            reader.join()
        return self._process.returncode

    def _read_stages(self, stream: IO[str]) -> None:
        for line in stream:
            self.stage = line.strip()
            self._heard = time.monotonic()

    def _read_errors(self, stream: IO[str]) -> None:
        for line in stream:
            text = line.rstrip("\n")
            self.errors.append(text)
            self._reporting = _BEGIN in text or (self._reporting and not text.startswith(_END))
            self._heard = time.monotonic()
