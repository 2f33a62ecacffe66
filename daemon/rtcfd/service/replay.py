"""One replay: it lasts as long as the call that makes it; when the caller leaves it is ended."""

from rtcf.v1 import control_pb2, errors_pb2

from rtcfd.common.refusals import FailedPrecondition, InvalidArgument
from rtcfd.operations.loop import stop_quietly
from rtcfd.recovery import starting
from rtcfd.runners.runner import Runner
from rtcfd.runners.runners import Runners


class Replay:
    """Owned by the call; pieces come in order."""

    def __init__(self, runners: Runners) -> None:
        self._runners = runners
        self._runner: Runner | None = None  # whose replay is under way
        self._stops = 0  # of its loop, when it was asked for
        self._ended = False
        self._gone = False  # its caller

    async def take(self, request: control_pb2.ReplayRequest) -> control_pb2.ReplayResponse:
        """Run one piece; return what came of it."""
        if request.begin == (self._runner is not None) or self._ended:
            raise InvalidArgument(
                "a replay is one call, whose first message has `begin`, and no other",
                errors_pb2.REASON_REQUEST_MALFORMED,
                field="begin",
            )
        if not request.begin:
            assert self._runner is not None
            self._require_no_stop(self._runner)
            response = await starting.replay(self._runner, request)
            if request.end and not response.more:
                self._runner, self._ended = None, True
            return response
        runner = self._runners.get(request.runner)
        self._stops = runner.loop.stops
        return await starting.replay(runner, request, lambda: self._begun(runner))

    def _begun(self, runner: Runner) -> None:
        """The executor replays from here on, for a caller who may have left meanwhile."""
        self._runner = runner
        if self._gone:
            self.lost()

    def _require_no_stop(self, runner: Runner) -> None:
        """Refuse to go on after a stop: what is replayed there now is somebody else's."""
        if runner.loop.stops != self._stops:
            raise FailedPrecondition(
                f"runner {runner.name}: its loop was stopped, and this replay with it: "
                "begin another",
                errors_pb2.REASON_LOOP_STOPPED,
            )

    async def end(self) -> None:
        """End one that its caller did not."""
        if (runner := self._left()) is not None:
            await stop_quietly(runner)

    def lost(self) -> None:
        """Likewise, where nobody waits any more."""
        self._gone = True
        if (runner := self._left()) is not None:
            runner.operations.in_background("the end of a replay", stop_quietly(runner))

    def _left(self) -> Runner | None:
        """Return the runner whose replay is to be ended.  After a stop by somebody else what runs
        there is not ours."""
        runner, self._runner = self._runner, None
        return runner if runner is not None and runner.loop.stops == self._stops else None
