"""A process that has imported the compiler, which takes longer than compiling most components.

`rtcfctl` starts it as `rtcf-compile --worker` and sends the arguments of each compilation as a line
of JSON, `{"arguments": […]}`. The worker answers with the lines of standard error, `{"line": …}`,
and with the exit code, `{"status": …}`. Each compilation runs in a child, with the rights of the
user: nothing of a component remains in the worker. It ends with rtcfctl, and when it was idle for
some minutes.
"""

import gc
import json
import mmap
import os
import select
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rtcf_compile import child
from rtcf_compile.main import REFUSED
from rtcf_compile.source import modules, progress  # noqa: F401, as before a module of the user runs

IDLE_S = 300.0
NICE = 5  # below the user's other programs
_BYTES = 65536


def serve() -> int:
    """Serve compilations until the end of standard input; return the exit code."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the child, and rtcfctl
    os.nice(NICE)
    worker = _Worker()
    worker.import_compiler()
    while (request := worker.request()) is not None:
        worker.compile(json.loads(request)["arguments"])
    return 0


class _Worker:
    """The state of the worker."""

    def __init__(self) -> None:
        # What Python has imported when it runs a module in an ordinary rtcf-compile.
        self._names = set(sys.modules)
        self._received = b""

    def import_compiler(self) -> None:
        """Import what every compilation needs."""
        import rtcf_compile.comparison.watched
        import rtcf_compile.library.build  # noqa: F401
        from rtcf_compile.machine_code import backend, identity

        backend.initialise()
        identity.versions()
        gc.collect()
        gc.freeze()

    def request(self) -> bytes | None:
        """Return the next request; None at the end of standard input, or after some minutes."""
        while b"\n" not in self._received:
            if not select.select([0], [], [], IDLE_S)[0]:
                return None
            read = os.read(0, _BYTES)
            if not read:
                return None
            self._received += read
        line, _, self._received = self._received.partition(b"\n")
        return line

    def compile(self, arguments: Sequence[str]) -> None:
        """Run one compilation in a child; answer with its lines and its exit code."""
        readable, writable = os.pipe()
        with mmap.mmap(-1, progress.BYTES) as shared:
            process = child.started(shared, arguments, lambda: self._prepare(arguments, writable))
            os.close(writable)
            self._forward(readable, process)
            status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
            if status < 0:
                _answer({"line": child.crash(status, shared)})
                status = REFUSED
        _answer({"status": status})

    def _prepare(self, arguments: Sequence[str], writable: int) -> None:
        """Make the child like an ordinary rtcf-compile."""
        signal.signal(signal.SIGINT, signal.default_int_handler)
        nothing = os.open(os.devnull, os.O_RDWR)
        for descriptor, to in ((nothing, 0), (nothing, 1), (writable, 2)):
            os.dup2(descriptor, to)
        sys.argv[1:] = arguments
        # A file of the user may have the name of a module that only the worker has imported.
        for file in (Path(each) for each in arguments if each.endswith(".py")):
            beside = {each.stem for each in file.resolve().parent.iterdir()}
            for name in [each for each in sys.modules if each not in self._names]:
                if name.partition(".")[0] in beside:
                    del sys.modules[name]

    def _forward(self, readable: int, process: int) -> None:
        """Forward the child's lines; end it if rtcfctl ends."""
        with open(readable, "rb", buffering=0) as lines:
            said = b""
            while True:
                ready = select.select([0, lines], [], [])[0]
                if 0 in ready and not self._is_connected():
                    os.kill(process, signal.SIGTERM)
                    os._exit(0)
                if lines in ready:
                    read = lines.read(_BYTES)
                    *whole, said = (said + read).split(b"\n")
                    if not read and said:
                        whole.append(said)
                    for line in whole:
                        _answer({"line": line.decode(errors="replace")})
                    if not read:
                        return

    def _is_connected(self) -> bool:
        read = os.read(0, _BYTES)
        self._received += read
        return bool(read)


def _answer(message: dict[str, Any]) -> None:
    """Send a message; end if rtcfctl has ended."""
    try:
        os.write(1, json.dumps(message).encode() + b"\n")
    except BrokenPipeError:
        os._exit(0)
