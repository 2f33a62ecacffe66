"""One replay, which lasts as long as its call; it ends if the caller disconnects."""

from rtcf.v1 import control_pb2, errors_pb2

from rtcfd.common.errors import FailedPrecondition, InvalidArgument
from rtcfd.operations.loop import stop_quietly
from rtcfd.recovery import cycles
from rtcfd.runners.runner import Runner
from rtcfd.runners.runners import Runners


class Replay:
    """Owned by the call; pieces come in order."""

    def __init__(self, runners: Runners) -> None:
        self._runners = runners
        self._runner: Runner | None = None  # runs the replay; None: none is running
        self._stops = 0  # the stop count of its loop when the replay was requested
        self._ended = False
        self._gone = False  # the caller has disconnected

    async def take(self, request: control_pb2.ReplayRequest) -> control_pb2.ReplayResponse:
        """Run one piece of the recording; return its result."""
        if request.begin == (self._runner is not None) or self._ended:
            raise InvalidArgument(
                "a replay is one call: its first message must have `begin`, the others must not",
                errors_pb2.REASON_REQUEST_MALFORMED,
                field="begin",
            )
        if not request.begin:
            assert self._runner is not None
            self._require_no_stop(self._runner)
            response = await cycles.replay(self._runner, request)
            if request.end and not response.more:
                self._runner, self._ended = None, True
            return response
        runner = self._runners.get(request.runner)
        self._stops = runner.loop.stops
        return await cycles.replay(runner, request, lambda: self._begun(runner))

    def _begun(self, runner: Runner) -> None:
        """Note that the executor replays; the caller may have disconnected meanwhile."""
        self._runner = runner
        if self._gone:
            self.lost()

    def _require_no_stop(self, runner: Runner) -> None:
        """Raise FailedPrecondition after a stop: a replay that runs there now is another one."""
        if runner.loop.stops != self._stops:
            raise FailedPrecondition(
                f"runner {runner.name}: its loop was stopped, and this replay with it: "
                "begin another",
                errors_pb2.REASON_LOOP_STOPPED,
            )

    async def end(self) -> None:
        """End the replay, if its caller has not."""
        if (runner := self._left()) is not None:
            await stop_quietly(runner)

    def lost(self) -> None:
        """End the replay in the background, after the loss of the caller."""
        self._gone = True
        if (runner := self._left()) is not None:
            runner.operations.in_background("the end of a replay", stop_quietly(runner))

    def _left(self) -> Runner | None:
        """Return the runner whose replay is to be ended, if any.

        None after a stop by another caller: a replay that runs there now is not ours.
        """
        runner, self._runner = self._runner, None
        return runner if runner is not None and runner.loop.stops == self._stops else None
