"""Imports a program and forks it for each request, see warm_start.py.

warm_server.py PROGRAM BUILD_TREE SOCKET
"""

import gc
import importlib
import json
import os
import selectors
import signal
import socket
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

_LARGEST = 1 << 20  # bytes of a request
_DESCRIPTORS = 3  # of a request: output, errors, and the socket for the answers
# Not all modules: rtcfctl imports those of its verb only.
_IMPORTS = {
    "rtcfctl": ["rtcfctl.main", "rtcfctl.terminal.output", "rtcf", "rtcf.connection", "grpc.aio"],
    "rtcfd": ["rtcfd.main", "grpc.aio"],
}
_INTERRUPT = signal.getsignal(signal.SIGINT)


def _become(program: str, build: Path, request: dict[str, Any], descriptors: Sequence[int]) -> None:
    """Run the program in this process, a fork."""
    os.dup2(descriptors[0], 1)
    os.dup2(descriptors[1], 2)
    for descriptor in descriptors:
        os.close(descriptor)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    if request["session"]:
        os.setsid()
    if program == "rtcfd":
        signal.signal(signal.SIGINT, _INTERRUPT)
    sys.argv = [str(build / "bin" / program), *request["words"]]
    main = sys.modules[f"{program}.main"]
    status = main.main(build_tree=build)
    if program == "rtcfd":
        main.end(status)
    sys.exit(status)


class _Server:
    """Forks the program for each request, and answers with its process id and later its status."""

    def __init__(self, program: str, build: Path, requests: socket.socket) -> None:
        self._program = program
        self._build = build
        self._requests = requests
        self._selector = selectors.DefaultSelector()
        self._running: dict[int, tuple[int, socket.socket]] = {}  # by pidfd

    def serve(self) -> None:
        """Serve until the other side ends."""
        self._selector.register(self._requests, selectors.EVENT_READ)
        while True:
            for key, _ in self._selector.select():
                if key.fileobj is not self._requests:
                    self._report(key.fd)
                    continue
                text, descriptors, _, _ = socket.recv_fds(self._requests, _LARGEST, _DESCRIPTORS)
                if not text:
                    return
                self._fork(json.loads(text), descriptors)

    def _fork(self, request: dict[str, Any], descriptors: Sequence[int]) -> None:
        pid = os.fork()
        if pid == 0:
            self._requests.close()
            self._selector.close()
            for descriptor, (_, answers) in self._running.items():
                os.close(descriptor)
                answers.close()
            _become(self._program, self._build, request, descriptors)
        out, err, answering = descriptors
        os.close(out)
        os.close(err)
        answers = socket.socket(fileno=answering)
        answers.send(str(pid).encode())
        descriptor = os.pidfd_open(pid)
        self._running[descriptor] = (pid, answers)
        self._selector.register(descriptor, selectors.EVENT_READ)

    def _report(self, descriptor: int) -> None:
        """Answer with the status of a program that has ended, and its processor time."""
        pid, answers = self._running.pop(descriptor)
        self._selector.unregister(descriptor)
        os.close(descriptor)
        _, status, used = os.wait4(pid, 0)
        answer = f"{os.waitstatus_to_exitcode(status)} {used.ru_utime + used.ru_stime:.3f}"
        with answers, suppress(OSError):  # nobody may wait for it
            answers.send(answer.encode())


def _main() -> None:
    program, build = sys.argv[1], Path(sys.argv[2])
    requests = socket.socket(fileno=int(sys.argv[3]))
    os.set_inheritable(requests.fileno(), False)
    sys.path[:] = [str(build / "python"), *sys.path]
    # Of this process, and of rtcfctl as in build/bin/rtcfctl.
    if _INTERRUPT is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    for module in _IMPORTS[program]:
        importlib.import_module(module)
    gc.freeze()  # the programs then share these modules' memory, also when they end
    _Server(program, build, requests).serve()


if __name__ == "__main__":
    _main()
