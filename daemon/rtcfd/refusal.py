"""The one place where refusals become gRPC status codes."""

import logging
from typing import Any, NoReturn

import grpc

from rtcfd import errors

log = logging.getLogger(__name__)

STATUS_CODES: dict[type[errors.Refusal], grpc.StatusCode] = {
    errors.InvalidArgument: grpc.StatusCode.INVALID_ARGUMENT,
    errors.NotFound: grpc.StatusCode.NOT_FOUND,
    errors.AlreadyExists: grpc.StatusCode.ALREADY_EXISTS,
    errors.FailedPrecondition: grpc.StatusCode.FAILED_PRECONDITION,
    errors.Unavailable: grpc.StatusCode.UNAVAILABLE,
    errors.PermissionDenied: grpc.StatusCode.PERMISSION_DENIED,
    errors.ResourceExhausted: grpc.StatusCode.RESOURCE_EXHAUSTED,
}
# Tells a client that rtcfd itself spoke, and not gRPC about a lost connection.
REFUSAL_KEY = "rtcf-refusal"


async def abort(context: Any, error: Exception) -> NoReturn:
    """End a call with what an error says."""
    if isinstance(error, errors.Refusal):
        code = next(
            (found for kind in type(error).__mro__ if (found := STATUS_CODES.get(kind))),
            grpc.StatusCode.FAILED_PRECONDITION,
        )
        text = " ".join(str(error).split())
    else:
        log.error("internal error", exc_info=error)
        code = grpc.StatusCode.INTERNAL
        text = f"internal error of rtcfd ({type(error).__name__}: {error}); its log has more"
    await context.abort(code, text, ((REFUSAL_KEY, "1"),))
    raise AssertionError("abort() always raises")
