"""Imports a program and forks it for each request, see warm_start.py.

warm_server.py PROGRAM BUILD_TREE SOCKET
"""

import array
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


def _serve(program: str, build: Path, requests: socket.socket) -> None:
    """Fork the program for each request, until the other side ends."""
    selector = selectors.DefaultSelector()
    selector.register(requests, selectors.EVENT_READ)
    running: dict[int, tuple[int, socket.socket]] = {}  # by pidfd
    while True:
        for key, _ in selector.select():
            if key.fileobj is not requests:
                descriptor = key.fd
                pid, answers = running.pop(descriptor)
                selector.unregister(descriptor)
                os.close(descriptor)
                _, status, used = os.wait4(pid, 0)
                answer = f"{os.waitstatus_to_exitcode(status)} {used.ru_utime + used.ru_stime:.3f}"
                with answers, suppress(OSError):  # nobody may wait for it
                    answers.send(answer.encode())
                continue
            space = socket.CMSG_SPACE(_DESCRIPTORS * 4)
            text, control, _, _ = requests.recvmsg(_LARGEST, space)
            if not text:
                return
            descriptors = array.array("i", control[0][2])
            pid = os.fork()
            if pid == 0:
                requests.close()
                selector.close()
                for descriptor, (_, answers) in running.items():
                    os.close(descriptor)
                    answers.close()
                running.clear()
                _become(program, build, json.loads(text), descriptors)
            os.close(descriptors[0])
            os.close(descriptors[1])
            answers = socket.socket(fileno=descriptors[2])
            answers.send(str(pid).encode())
            descriptor = os.pidfd_open(pid)
            running[descriptor] = (pid, answers)
            selector.register(descriptor, selectors.EVENT_READ)


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
    _serve(program, build, requests)


if __name__ == "__main__":
    _main()
