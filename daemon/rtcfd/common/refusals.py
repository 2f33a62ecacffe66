"""The exceptions of rtcfd: a refusal, in one line, and its kind.

A refusal has changed nothing.  status_codes.py maps the kinds to gRPC status codes,
executor/link.py maps the executor's error codes to them.
"""


class Refusal(Exception):
    """A request is refused; the text says what, where and how to mend it."""


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


class PermissionDenied(Refusal):
    """The caller may not do that."""


class ResourceExhausted(Refusal):
    """A limit of the settings is reached."""
