"""The numbered log of events.  Owned by the daemon."""

import time

from rtcf.v1 import control_pb2, runner_pb2

from rtcfd.common.numbered_log import NumberedLog

_LONGEST = 1000  # characters of a message

Kind = control_pb2.Event.Kind


class EventLog(NumberedLog[control_pb2.Event]):
    """The last events."""

    def add(
        self,
        kind: "control_pb2.Event.Kind",
        message: str,
        runner: str = "",
        state: "runner_pb2.RunnerState" = runner_pb2.RUNNER_STATE_UNSPECIFIED,
        component: str = "",
        iteration: int = 0,
        user: str = "",
        holder: str = "",
    ) -> None:
        """Append an event that has just happened; see Event in control.proto."""
        line = " ".join(message.split())
        self.append(
            control_pb2.Event(
                sequence=self.last + 1,
                time_ns=time.time_ns(),
                kind=kind,
                runner=runner,
                state=state,
                message=line if len(line) <= _LONGEST else f"{line[:_LONGEST]}…",
                component=component,
                iteration=iteration,
                user=user,
                holder=holder,
            )
        )
