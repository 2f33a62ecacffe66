"""A process that runs a component, and is ended if it says nothing for too long.

Its standard output tells what it is about to do, its standard error what it finds.
"""

import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from typing import IO

# Of a hook or of some updates; what takes longer would stop a real loop.
HANG_S = 10.0
# A report is made within the cycle, and finding its source lines may take long.
_REPORT_S = 120.0
_POLL_S = 0.05
_BEGIN, _END = "==ERROR: RealtimeSanitizer: ", "SUMMARY: "


class Watched:
    """The process; owned by who waits for it."""

    def __init__(self, command: Sequence[str], environment: Mapping[str, str]) -> None:
        self.stage = ""  # what it is doing
        self.errors: list[str] = []  # lines
        self.hang = ""  # what did not return
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
        """Wait for its end; return its exit status, negative of a signal.

        It is ended after `hang_s` without a word.
        """
        for reader in self._readers:
            reader.start()
        try:
            while self._process.poll() is None:
                limit = _REPORT_S if self._reporting else hang_s
                if time.monotonic() - self._heard > limit:
                    self.hang = (
                        f"the component does not return: nothing for {limit:g} s while "
                        f"{self.stage or 'it was loaded'}"
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
