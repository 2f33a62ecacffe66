"""The one place where refusals become gRPC status codes."""

import logging
from typing import Any, NoReturn
from urllib.parse import quote

import grpc

from rtcfd.common import refusals

log = logging.getLogger(__name__)

STATUS_CODES: dict[type[refusals.Refusal], grpc.StatusCode] = {
    refusals.InvalidArgument: grpc.StatusCode.INVALID_ARGUMENT,
    refusals.NotFound: grpc.StatusCode.NOT_FOUND,
    refusals.AlreadyExists: grpc.StatusCode.ALREADY_EXISTS,
    refusals.FailedPrecondition: grpc.StatusCode.FAILED_PRECONDITION,
    refusals.Unavailable: grpc.StatusCode.UNAVAILABLE,
    refusals.PermissionDenied: grpc.StatusCode.PERMISSION_DENIED,
    refusals.ResourceExhausted: grpc.StatusCode.RESOURCE_EXHAUSTED,
}
# Tells a client that rtcfd itself spoke, and not gRPC about a lost connection.
REFUSAL_KEY = "rtcf-refusal"


# A refusal travels as metadata, of which a client that is not ours takes 8 KiB.
_LONGEST = 4000  # bytes, as they are encoded


def bounded(text: object) -> str:
    """Return one line that fits: of what is too long, begin and end, which says what to do."""
    line = " ".join(str(text).split())
    longest = _LONGEST
    while len(quote(line)) > _LONGEST:
        longest //= 2
        line = f"{line[: longest // 2]} … {line[-longest // 2 :]}"
    return line


async def abort(context: Any, error: Exception) -> NoReturn:
    """End a call with what an error says."""
    if isinstance(error, refusals.Refusal):
        code = next(
            (found for kind in type(error).__mro__ if (found := STATUS_CODES.get(kind))),
            grpc.StatusCode.FAILED_PRECONDITION,
        )
        text = bounded(error)
    else:
        log.error("internal error", exc_info=error)
        code = grpc.StatusCode.INTERNAL
        text = bounded(
            f"internal error of rtcfd ({type(error).__name__}: {error}); its log has more"
        )
    await context.abort(code, text, ((REFUSAL_KEY, "1"),))
    raise AssertionError("abort() always raises")
