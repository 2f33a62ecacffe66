"""Converts errors to gRPC statuses: a line for people, a reason code for programs."""

import logging
from typing import Any, NoReturn
from urllib.parse import quote

import grpc
from rtcf.v1 import errors_pb2

from rtcfd.common import errors
from rtcfd.common.errors import RequestError

log = logging.getLogger(__name__)

STATUS_CODES: dict[type[RequestError], grpc.StatusCode] = {
    errors.InvalidArgument: grpc.StatusCode.INVALID_ARGUMENT,
    errors.NotFound: grpc.StatusCode.NOT_FOUND,
    errors.AlreadyExists: grpc.StatusCode.ALREADY_EXISTS,
    errors.FailedPrecondition: grpc.StatusCode.FAILED_PRECONDITION,
    errors.Unavailable: grpc.StatusCode.UNAVAILABLE,
    errors.PermissionDenied: grpc.StatusCode.PERMISSION_DENIED,
    errors.ResourceExhausted: grpc.StatusCode.RESOURCE_EXHAUSTED,
    errors.Internal: grpc.StatusCode.INTERNAL,
}
DOMAIN = "rtcf"
DETAILS_KEY = "grpc-status-details-bin"
INFO_TYPE = "type.googleapis.com/google.rpc.ErrorInfo"

# An error travels as metadata, of which other gRPC clients accept at most 8 KiB: the line twice
# (as gRPC's message, and in the details, where base64 makes four bytes of three), and the names.
_LONGEST = 2600  # bytes of the encoded line
_LONGEST_NAME = 100  # bytes
_MOST_NAMES = 8


def bounded(text: object) -> str:
    """Return one line that fits into the metadata.

    A longer text keeps its beginning and its end, which has the remedy.
    """
    line = " ".join(str(text).split())
    longest = _LONGEST
    while len(quote(line)) > _LONGEST:
        longest //= 2
        line = f"{line[: longest // 2]} … {line[-longest // 2 :]}"
    return line


def details(error: RequestError) -> bytes:
    """Return the content of `grpc-status-details-bin`, at most 4 KiB."""
    info = errors_pb2.ErrorInfo(
        reason=errors_pb2.Reason.Name(error.reason).removeprefix("REASON_"), domain=DOMAIN
    )
    for key, value in list(error.about.items())[:_MOST_NAMES]:
        # A truncated name would be another name, so a long one is only in the line.
        if len(value.encode(errors="replace")) <= _LONGEST_NAME:
            info.metadata[key] = value
    status = errors_pb2.ErrorStatus(code=status_code(error).value[0], message=bounded(error))
    status.details.add(type_url=INFO_TYPE, value=info.SerializeToString(deterministic=True))
    encoded: bytes = status.SerializeToString()
    return encoded


def status_code(error: RequestError) -> grpc.StatusCode:
    """Return the gRPC status code of an error."""
    return next(
        (found for kind in type(error).__mro__ if (found := STATUS_CODES.get(kind))),
        grpc.StatusCode.FAILED_PRECONDITION,
    )


async def abort(context: Any, error: Exception, request: Any = None) -> NoReturn:
    """End a call with an error, to which the names in the call's `request` are added."""
    if isinstance(error, RequestError):
        failure = error
    else:
        log.error("internal error", exc_info=error)
        failure = errors.Internal(
            f"internal error of rtcfd ({type(error).__name__}: {error}): see its log",
            errors_pb2.REASON_INTERNAL,
        )
    for key in ("runner", "component"):
        named = getattr(request, key, None)
        if isinstance(named, str) and named:
            failure.about.setdefault(key, named)
    await context.abort(status_code(failure), bounded(failure), ((DETAILS_KEY, details(failure)),))
    raise AssertionError("abort() always raises")
