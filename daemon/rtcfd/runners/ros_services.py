"""What ROS peers ask of a runner by the services of its executor's node.

Called by the Runner.  ROS knows no users: everybody who reaches the node may
call, so what they may have done is one setting, in the words of `[access]`.
"""

import logging

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2

from rtcfd.access.rights import Level
from rtcfd.common.refusals import FailedPrecondition, Refusal
from rtcfd.operations import graph
from rtcfd.operations.loop import stop
from rtcfd.operations.runner_core import RunnerCore
from rtcfd.recovery.starting import start

_NEEDED = {
    "start": Level.OPERATE,
    "stop": Level.OPERATE,
    "load": Level.ADMIN,
    "unload": Level.ADMIN,
}

log = logging.getLogger(__name__)


class RosServices:
    """Does what is called for, or refuses it; `access` is what all callers may do."""

    def __init__(self, access: Level) -> None:
        self.access = access

    async def serve(self, runner: RunnerCore, call: wire.ServiceCall) -> wire.ServiceAnswer:
        """Return the answer to a call; never raises."""
        answer = wire.ServiceAnswer(call=call.call)
        try:
            kind = self._allowed(runner, call)
            runner.log.info("a ROS service asks for: %s", kind)
            result = await _change(runner, call)
            answer.success = True
            answer.message = "; ".join(result.notes)
        except Refusal as refusal:
            answer.message = " ".join(str(refusal).split())
            runner.log.warning("refused to a ROS service: %s", answer.message)
        except Exception as error:
            answer.message = f"internal error of rtcfd ({type(error).__name__}); its log has more"
            log.exception("internal error")
        return answer

    def _allowed(self, runner: RunnerCore, call: wire.ServiceCall) -> str:
        kind = call.WhichOneof("kind")
        if kind is None:
            raise FailedPrecondition(
                f"runner {runner.name}: a call of unknown kind: install rtcfd and its executor of "
                "the same version"
            )
        needed = _NEEDED[kind]
        if self.access < needed:
            raise FailedPrecondition(
                f"rtcfd lets callers on ROS only {self.access.word}, and `{kind}` needs "
                f'{needed.word}: set ros_services = "{needed.word}" in [daemon] of '
                "/etc/rtcfd/rtcfd.toml, or use "
                f"rtcfctl -r {runner.name} {kind}"
            )
        return str(kind)


async def _change(runner: RunnerCore, call: wire.ServiceCall) -> control_pb2.ChangeResult:
    kind = call.WhichOneof("kind")
    if kind == "load":
        return await graph.load(runner, call.load, _ignore)
    if kind == "unload":
        return await graph.unload(runner, [call.unload], _ignore)
    return await (start if kind == "start" else stop)(runner, _ignore)


def _ignore(_line: str) -> None:
    """Take progress that nobody hears of."""
