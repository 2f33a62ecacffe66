"""A second loop that must run undisturbed during a test."""

import rtcf
from realtime_thread import RealtimeThread, Usage
from rtcf.v1 import runner_pb2
from values import port_value

_NAME = "bystander"


class Bystander:
    """A runner with a component that counts its cycles."""

    runner = _NAME

    def __init__(
        self, client: rtcf.Client, settings: runner_pb2.RunnerSettings | None = None
    ) -> None:
        self._client = client
        client.add_runner(_NAME, settings)
        client.load(rtcf.component("rtcf_test", "Counter", name="counts"), _NAME)
        client.start(_NAME)
        self._thread = RealtimeThread(client, _NAME)

    def usage(self) -> Usage:
        """Return the resource usage of its real-time thread so far."""
        return self._thread.usage()

    def check(self) -> None:
        """Check that it ran all the time, and end it."""
        status = self._client.get_status(_NAME).runners[0]
        assert status.state == runner_pb2.RUNNER_STATE_RUNNING, status.status
        assert (status.pid, status.realtime_tid) == (self._thread.process, self._thread.id)
        self._thread.check()
        self._client.stop(_NAME)
        cycles = self._client.get_status(_NAME).runners[0].iteration
        assert port_value(self._client, "counts", "out", _NAME) == cycles
        self._client.remove_runner(_NAME)
