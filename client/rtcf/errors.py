"""What can go wrong for a client, as exceptions."""

from collections.abc import Mapping

from rtcf_shared.errors import RtcfError as RtcfError


class RefusedError(RtcfError):
    """rtcfd refused the request; nothing has changed.

    Each reason has a class of its own in rtcf.refusals, by the name of the reason:
    RUNNER_NOT_FOUND is RunnerNotFoundError.

    reason   name of rtcf.v1.Reason without REASON_; empty: rtcfd gave none
    code     name of the gRPC status, e.g. "NOT_FOUND"
    about    what it is about, e.g. {"runner": "arm", "suggestion": "arm_1"}
    """

    def __init__(
        self, message: str, code: str, reason: str = "", about: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(message)
        self.code = code
        self.reason = reason
        self.about: dict[str, str] = dict(about or {})


class DaemonUnreachableError(RtcfError):
    """rtcfd does not run, does not answer, or may not be asked.

    `what` is the message without how to mend it; `denied`: its socket is not ours to use.
    """

    def __init__(self, what: str, remedy: str = "", *, denied: bool = False) -> None:
        super().__init__(f"{what}: {remedy}" if remedy else what)
        self.what = what
        self.denied = denied
