"""`rtcfctl -H HOST`: forwards the control socket of another machine through ssh."""

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

_THROUGH = "rtcfctl is through"  # marks the connection; a login shell may print before it
_END_S = 5.0


@contextmanager
def control_socket_of(host: str, socket: str | None) -> Iterator[str]:
    """Yield the path of a local socket that ssh forwards to the socket of the other machine.

    rtcfd there sees the user of the ssh session.  ssh uses the terminal for its prompts and error
    messages.  Raises ValueError, and DaemonUnreachableError if ssh cannot connect.
    """
    if not host or host.startswith("-") or not host.isprintable():
        raise ValueError(f"-H {host!r}: use HOST or USER@HOST, as for ssh")
    there = socket or DEFAULT_SOCKET
    if not there.startswith("/") or ":" in there:
        raise ValueError(f"--socket {there}: with -H, use an absolute path without a colon")
    with tempfile.TemporaryDirectory(prefix="rtcfctl-") as folder:
        here = Path(folder) / "control.sock"
        with _ssh("-L", f"{here}:{there}", "--", host, f"echo {_THROUGH} && exec cat") as process:
            assert process.stdout is not None
            if not any(line.rstrip() == _THROUGH for line in process.stdout):
                raise rtcf.DaemonUnreachableError(f"ssh cannot connect to {host}")
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
            process.stdin.close()  # ends cat on the other machine, and then ssh
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                process.kill()


def _leave_ctrl_c_to_us() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
