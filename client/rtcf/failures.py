"""The mapping of gRPC errors to exceptions of this library."""

import errno
import os
import socket as sockets
import stat
from collections.abc import Mapping
from typing import Any

from rtcf.errors import DaemonUnreachableError, RefusedError, RtcfError

# Metadata of errors from rtcfd; errors of gRPC itself, e.g. a lost connection, lack it.
_DETAILS_KEY = "grpc-status-details-bin"
_INFO_TYPE = "type.googleapis.com/google.rpc.ErrorInfo"
_DOMAIN = "rtcf"
_PROBE_TIMEOUT_S = 1.0
_TIMED_OUT = "timed out"  # in gRPC's text: the socket accepted the connection, but nobody answers


def refused(
    message: str, code: str, reason: str, about: Mapping[str, str] | None = None
) -> RefusedError:
    """Return the RefusedError for a reason; see RefusedError for the arguments."""
    from rtcf import reasons

    return reasons.BY_REASON.get(reason, RefusedError)(message, code, reason, about)


def from_grpc(error: Any, socket: str) -> RtcfError:
    """Return the exception for a grpc.RpcError of a call through `socket`."""
    code = error.code().name
    text = error.details() or code
    if details := _details(error):
        return _from_details(text, code, details)
    if code == "UNAVAILABLE":
        return _unreachable(socket, text)
    if code == "DEADLINE_EXCEEDED":
        return _silent(socket)
    if code == "UNIMPLEMENTED":
        return RtcfError(f"rtcfd at {socket} is older than this client: {text}")
    if code == "RESOURCE_EXHAUSTED":  # without details from rtcfd: gRPC's size limit
        return RtcfError(
            "the request is larger than rtcfd accepts: send less at a time, or raise message_kb "
            f"under [limits] in its settings ({text})"
        )
    return RtcfError(f"{text} ({code})")


def _details(error: Any) -> bytes:
    """Return rtcfd's details of an error; empty if the error is from gRPC."""
    for key, value in error.trailing_metadata() or ():
        if key == _DETAILS_KEY:
            return bytes(value)
    return b""


def _from_details(text: str, code: str, details: bytes) -> RefusedError:
    from google.protobuf.message import DecodeError

    from rtcf.v1 import errors_pb2

    try:
        for each in errors_pb2.ErrorStatus.FromString(details).details:
            if each.type_url == _INFO_TYPE:
                info = errors_pb2.ErrorInfo.FromString(each.value)
                if info.domain == _DOMAIN:
                    return refused(text, code, info.reason, info.metadata)
    except DecodeError:
        pass
    return RefusedError(text, code)


def is_crowded(error: Any, socket: str) -> bool:
    """Return whether a call failed because the listen queue of rtcfd's socket is full."""
    if error.code().name != "UNAVAILABLE" or _details(error):
        return False
    text = error.details() or ""
    if "failed to connect" not in text or _TIMED_OUT in text:
        return False
    # gRPC does not report EAGAIN as such: check that a server listens.
    with sockets.socket(sockets.AF_UNIX, sockets.SOCK_STREAM) as probe:
        probe.setblocking(False)
        return probe.connect_ex(socket) in (0, errno.EAGAIN)


def _unreachable(socket: str, text: str) -> DaemonUnreachableError:
    """Return the cause by another attempt to connect; gRPC's message does not name it."""
    try:
        with sockets.socket(sockets.AF_UNIX, sockets.SOCK_STREAM) as probe:
            probe.settimeout(_PROBE_TIMEOUT_S)
            probe.connect(socket)
    except PermissionError:
        return DaemonUnreachableError(
            f"permission denied on {socket}", _who_may(socket), denied=True
        )
    except (FileNotFoundError, ConnectionRefusedError):
        return DaemonUnreachableError(
            f"rtcfd is not running at {socket}",
            "start it with `sudo systemctl start rtcfd`, or name another socket with --socket or "
            "RTCF_SOCKET",
        )
    except BlockingIOError:
        return _silent(socket)  # its queue of connections is full
    except OSError as error:
        return DaemonUnreachableError(
            f"cannot reach rtcfd at {socket}", f"{error.strerror or error}"
        )
    if _TIMED_OUT in text:
        return _silent(socket)
    return DaemonUnreachableError(f"the connection to rtcfd at {socket} was lost", text)


def _silent(socket: str) -> DaemonUnreachableError:
    remedy = ""
    if owner := stranger(socket):
        remedy = f"its socket belongs to {owner}; name another one with --socket or RTCF_SOCKET"
    return DaemonUnreachableError(f"rtcfd at {socket} does not answer in time", remedy)


def stranger(socket: str) -> str:
    """Return the owner of a socket, for a message; empty = root, this user, or no socket."""
    import pwd

    try:
        owner = os.stat(socket).st_uid
    except OSError:
        return ""
    if owner in (0, os.geteuid()):
        return ""
    try:
        return f"user {pwd.getpwuid(owner).pw_name}"
    except KeyError:
        return f"uid {owner}"


def _user() -> str:
    import getpass

    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return f"#{os.getuid()}"


def _who_may(socket: str) -> str:
    """Return how to get access to a socket, or why not; never suggest the group root."""
    import grp
    import pwd

    try:
        found = os.stat(socket)
        if found.st_mode & stat.S_IWGRP and found.st_gid != 0:
            group = grp.getgrgid(found.st_gid).gr_name
            return f"join its group (`sudo adduser {_user()} {group}`) and log in again"
        owner = pwd.getpwuid(found.st_uid).pw_name
    except (KeyError, OSError):
        return "only its owner has access"
    return f"it belongs to the private rtcfd of user {owner}"
