"""`rtcfctl -H HOST`: the control socket of another machine, by way of ssh."""

import os
import shlex
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from subprocess import PIPE

import rtcf
from rtcf.connection import DEFAULT_SOCKET

_THROUGH = "rtcfctl is through"  # what a login shell says before that is not ours
_END_S = 5.0


@contextmanager
def control_socket_of(host: str, socket: str | None) -> Iterator[str]:
    """Give a socket of ours behind which is that of the other machine.

    rtcfd there sees whom ssh has logged in.  What ssh asks and complains of is between it and the
    terminal.  Raises ValueError, and DaemonUnreachableError if ssh does not come through.
    """
    if not host or host.startswith("-") or not host.isprintable():
        raise ValueError(f"-H {host!r}: a host, or USER@HOST, as for ssh")
    there = socket or DEFAULT_SOCKET
    if not there.startswith("/") or ":" in there:
        raise ValueError(f"--socket {there}: with -H, a path from / on, without a colon")
    with tempfile.TemporaryDirectory(prefix="rtcfctl-") as folder:
        here = Path(folder) / "control.sock"
        with _ssh("-L", f"{here}:{there}", "--", host, f"echo {_THROUGH} && exec cat") as process:
            assert process.stdout is not None
            if not any(line.rstrip() == _THROUGH for line in process.stdout):
                raise rtcf.DaemonUnreachableError(f"ssh does not get through to {host}")
            yield str(here)


@contextmanager
def _ssh(*words: str) -> Iterator["subprocess.Popen[str]"]:
    command = shlex.split(os.environ.get("RTCF_SSH", "ssh"))
    options = ("-T", "-o", "ExitOnForwardFailure=yes", "-o", "StreamLocalBindMask=0177")
    try:
        process = subprocess.Popen(
            [*command, *options, *words], stdin=PIPE, stdout=PIPE, text=True, errors="replace",
            preexec_fn=_leave_ctrl_c_to_us,
        )  # fmt: skip
    except OSError as error:
        raise rtcf.RtcfError(f"cannot run {command[0]}: {error.strerror}") from None
    with process:
        try:
            yield process
        finally:
            assert process.stdin is not None
            process.stdin.close()  # which ends what runs there, and with it ssh
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                process.kill()


def _leave_ctrl_c_to_us() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
