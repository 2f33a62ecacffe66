"""The exceptions of rtcfd: errors of one line, each with a kind and a reason code.

A request that raises one has changed nothing.  status_codes.py converts them to gRPC
statuses; executor/link.py creates them from the executor's errors.
"""

from rtcf.v1 import errors_pb2


class RequestError(Exception):
    """A request failed.  The text gives the cause, the names, and the remedy.

    For programs, `reason` gives the code (see errors.proto), and `about` the names, by the
    keys of ErrorInfo.metadata.  Empty names are left out.
    """

    def __init__(self, text: object, reason: "errors_pb2.Reason", **about: str) -> None:
        super().__init__(text)
        self.reason = reason
        self.about = {key: value for key, value in about.items() if value}


class InvalidArgument(RequestError):
    """The request itself is malformed."""


class NotFound(RequestError):
    """There is no such runner, component, port, package or type."""


class AlreadyExists(RequestError):
    """A runner or component of that name exists already."""


class FailedPrecondition(RequestError):
    """The state of the graph, a library, a hook or the machine does not allow it."""


class NoMaster(FailedPrecondition):
    """A hook needs a ROS master, but none answers."""


class Unavailable(RequestError):
    """The executor does not answer."""


class Silent(Unavailable):
    """The executor runs, and perhaps its loop, but it does not answer."""


class PermissionDenied(RequestError):
    """The caller lacks the right."""


class ResourceExhausted(RequestError):
    """A limit of the settings is reached."""


class Internal(RequestError):
    """A fault of rtcfd itself."""
