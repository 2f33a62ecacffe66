"""The exceptions of rtcfd: a refusal, in one line, with its kind and its reason.

A refusal has changed nothing.  status_codes.py makes gRPC's statuses of them;
executor/link.py makes them of the executor's errors.
"""

from rtcf.v1 import errors_pb2


class Refusal(Exception):
    """A request is refused; the text says what, where and how to mend it.

    `reason` says it for programs (see errors.proto), with what it is `about`: names by
    the keys of ErrorInfo.metadata.  What is empty says nothing.
    """

    def __init__(self, text: object, reason: "errors_pb2.Reason", **about: str) -> None:
        super().__init__(text)
        self.reason = reason
        self.about = {key: value for key, value in about.items() if value}


class InvalidArgument(Refusal):
    """The request itself is malformed."""


class NotFound(Refusal):
    """There is no such runner, component, port, package or type."""


class AlreadyExists(Refusal):
    """A runner or component of that name is there already."""


class FailedPrecondition(Refusal):
    """The graph, a library, a hook or the machine refuses."""


class NoMaster(FailedPrecondition):
    """A hook needs a ROS master, and none answers."""


class Unavailable(Refusal):
    """The executor does not answer."""


class Silent(Unavailable):
    """An executor that is there, and whose loop may be running, does not answer."""


class PermissionDenied(Refusal):
    """The caller may not do that."""


class ResourceExhausted(Refusal):
    """A limit of the settings is reached."""


class Internal(Refusal):
    """A fault of rtcfd itself."""
