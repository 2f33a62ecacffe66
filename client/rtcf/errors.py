"""The exceptions of the client library."""

from collections.abc import Mapping

from rtcf_shared.errors import RtcfError as RtcfError


class RefusedError(RtcfError):
    """rtcfd rejected the request; nothing has changed.

    Each reason has a subclass in rtcf.reasons, named by the reason: RunnerNotFoundError for
    RUNNER_NOT_FOUND.

    reason   name in rtcf.v1.Reason without REASON_; empty if rtcfd sent none
    code     name of the gRPC status, e.g. "NOT_FOUND"
    about    names in the error, e.g. {"runner": "arm", "suggestion": "arm_1"}
    """

    def __init__(
        self, message: str, code: str, reason: str = "", about: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(message)
        self.code = code
        self.reason = reason
        self.about: dict[str, str] = dict(about or {})


class DaemonUnreachableError(RtcfError):
    """rtcfd does not run, does not answer, or denies access to its socket.

    what     the message without the remedy
    denied   whether the caller has no access to the socket
    """

    def __init__(self, what: str, remedy: str = "", *, denied: bool = False) -> None:
        super().__init__(f"{what}: {remedy}" if remedy else what)
        self.what = what
        self.denied = denied
