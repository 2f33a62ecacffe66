"""What can go wrong for a client, and the one place where gRPC's errors become that."""

import errno
import os
import socket as sockets
import stat
from typing import Any

from rtcf_shared.errors import RtcfError as RtcfError

# Set by rtcfd on its own refusals; gRPC's word on a lost connection lacks it.
_REFUSAL_KEY = "rtcf-refusal"
_PROBE_TIMEOUT_S = 1.0


class RefusedError(RtcfError):
    """rtcfd refused the request; nothing has changed.

    `code` is the name of the gRPC status: INVALID_ARGUMENT, NOT_FOUND,
    ALREADY_EXISTS, FAILED_PRECONDITION or UNAVAILABLE.
    """

    def __init__(self, message: str, code: str) -> None:
        super().__init__(message)
        self.code = code


class DaemonUnreachableError(RtcfError):
    """rtcfd does not run, does not answer, or may not be asked."""


def from_grpc(error: Any, socket: str) -> RtcfError:
    """Return what a grpc.RpcError of a call through `socket` means."""
    code = error.code().name
    text = error.details() or code
    if any(key == _REFUSAL_KEY for key, _ in error.trailing_metadata() or ()):
        return RefusedError(text, code) if code != "INTERNAL" else RtcfError(text)
    if code == "UNAVAILABLE":
        return DaemonUnreachableError(_why_unreachable(socket, text))
    if code == "DEADLINE_EXCEEDED":
        return DaemonUnreachableError(f"rtcfd at {socket} does not answer in time")
    if code == "UNIMPLEMENTED":
        return RtcfError(f"rtcfd at {socket} is older than this client: {text}")
    if code == "RESOURCE_EXHAUSTED" and "larger than max" in text:
        return RtcfError(
            "the request is larger than rtcfd accepts: send less at a time, or raise message_kb "
            f"under [limits] in its settings ({text})"
        )
    return RtcfError(f"{text} ({code})")


def is_crowded(error: Any, socket: str) -> bool:
    """Tell whether a call did not get through as the queue at the door is full."""
    if error.code().name != "UNAVAILABLE" or any(
        key == _REFUSAL_KEY for key, _ in error.trailing_metadata() or ()
    ):
        return False
    if "failed to connect" not in (error.details() or ""):
        return False
    # What gRPC makes of a full queue is an invalid argument. Somebody listens there, though.
    with sockets.socket(sockets.AF_UNIX, sockets.SOCK_STREAM) as probe:
        probe.setblocking(False)
        return probe.connect_ex(socket) in (0, errno.EAGAIN)


def _why_unreachable(socket: str, text: str) -> str:
    """Say why, by trying once more by hand: gRPC's own words do not help people."""
    try:
        with sockets.socket(sockets.AF_UNIX, sockets.SOCK_STREAM) as probe:
            probe.settimeout(_PROBE_TIMEOUT_S)
            probe.connect(socket)
    except PermissionError:
        return f"permission denied on {socket}: {_who_may(socket)}"
    except (FileNotFoundError, ConnectionRefusedError):
        return (
            f"rtcfd is not running at {socket}: start it with `sudo systemctl start rtcfd`, "
            "or name another socket with --socket or RTCF_SOCKET"
        )
    except OSError as error:
        return f"cannot reach rtcfd at {socket}: {error.strerror or error}"
    return f"the connection to rtcfd at {socket} was lost: {text}"


def _user() -> str:
    import getpass

    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return f"#{os.getuid()}"


def _who_may(socket: str) -> str:
    """Say how to be let in, but for ways that give more than that."""
    import grp
    import pwd

    try:
        found = os.stat(socket)
        if found.st_mode & stat.S_IWGRP and found.st_gid != 0:
            group = grp.getgrgid(found.st_gid).gr_name
            return f"join its group (`sudo adduser {_user()} {group}`) and log in again"
        owner = pwd.getpwuid(found.st_uid).pw_name
    except (KeyError, OSError):
        return "its owner keeps it to himself"
    return f"it is the own rtcfd of user {owner}"
