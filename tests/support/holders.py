"""Clients that lease a runner or a component, like rt_runner and rt_launcher."""

import threading
from typing import Any

import rtcf
from daemon_process import wait_for
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2

STOP = control_pb2.ON_LEASE_LOST_STOP


class Holder:
    """Reads the messages of a lease in its own thread."""

    def __init__(self, lease: rtcf.Lease) -> None:
        self.lease = lease
        self.messages: list[Any] = []
        self.error: rtcf.RtcfError | None = None
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            for message in self.lease:
                self.messages.append(message)
        except rtcf.RtcfError as error:
            self.error = error

    def of(self, kind: str) -> list[Any]:
        """Return the messages of a kind received so far."""
        return [getattr(m, kind) for m in list(self.messages) if m.WhichOneof("kind") == kind]

    def wait(self, kind: str) -> Any:
        """Return the first message of a kind; fail if the call fails."""

        def come() -> Any:
            assert self.error is None, self.error
            return self.of(kind)

        return wait_for(come, f"a message {kind}")[0]

    def wait_for_error(self) -> rtcf.RtcfError:
        """Return the error of the failed call."""
        error: rtcf.RtcfError = wait_for(lambda: self.error, "an error")
        return error

    def why(self) -> int:
        """Return the reason for the end of the lease."""
        return int(self.wait("ended").why)

    def end(self) -> None:
        """End the lease in order."""
        self.lease.end()
        assert self.why() == control_pb2.LeaseEnded.WHY_ASKED


def lease(
    client: rtcf.Client,
    spec: graph_pb2.ComponentSpec,
    on_lost: Any = STOP,
    run: str = "run",
    **fields: Any,
) -> Holder:
    """Lease a component without waiting for it."""
    opening = control_pb2.OpenLease(
        component=spec, on_lost=on_lost, run_id=run, holder=f"holder of {spec.name}", **fields
    )
    return Holder(client.lease_component(opening))


def leased(
    client: rtcf.Client, spec: graph_pb2.ComponentSpec, *arguments: Any, **fields: Any
) -> Holder:
    """Lease a component, and wait until it is loaded."""
    holder = lease(client, spec, *arguments, **fields)
    holder.wait("loaded")
    return holder


def hold(
    client: rtcf.Client,
    runner: str = "",
    token: str = "token",
    settings: runner_pb2.RunnerSettings | None = None,
    attach: bool = False,
) -> Holder:
    """Lease a runner without waiting for it."""
    opening = control_pb2.OpenHold(
        runner=runner, settings=settings, token=token, holder=f"holder {token}", attach=attach
    )
    return Holder(client.hold_runner(opening))


def held(client: rtcf.Client, *arguments: Any, **fields: Any) -> Holder:
    """Lease a runner, and wait for the lease."""
    holder = hold(client, *arguments, **fields)
    holder.wait("taken")
    return holder
