"""Serves calls of the ROS services of a runner's node.

Called by the Runner.  ROS has no users, and every peer that reaches the node can call a service.
So one setting of the runner (`peers`) grants a right of `[access]` to all peers.
"""

import logging

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2

from rtcfd.access.calls import Level
from rtcfd.common.errors import FailedPrecondition, RequestError
from rtcfd.common.status_codes import bounded
from rtcfd.operations import graph
from rtcfd.operations.loop import stop
from rtcfd.operations.runner_core import RunnerCore
from rtcfd.recovery.cycles import start

_NEEDED = {
    "start": Level.OPERATE,
    "stop": Level.OPERATE,
    "load": Level.ADMIN,
    "unload": Level.ADMIN,
}

log = logging.getLogger(__name__)


async def serve(runner: RunnerCore, call: wire.ServiceCall) -> wire.ServiceAnswer:
    """Execute a call or reject it; return the answer, never raise."""
    answer = wire.ServiceAnswer(call=call.call)
    try:
        kind = _allowed(runner, call)
        runner.log.info("call of a ROS service: %s", kind)
        result = await _change(runner, call)
        answer.success = True
        lacks = [f"degraded real time: {line}" for line in result.degraded]
        answer.message = "; ".join([*result.notes, *lacks])
    except RequestError as error:
        answer.message = bounded(error)
        runner.log.warning("call of a ROS service rejected: %s", answer.message)
    except Exception as error:
        answer.message = f"internal error of rtcfd ({type(error).__name__}): see its log"
        log.exception("internal error")
    return answer


def _allowed(runner: RunnerCore, call: wire.ServiceCall) -> str:
    kind = call.WhichOneof("kind")
    if kind is None:
        raise FailedPrecondition(
            f"runner {runner.name}: a call of unknown kind: install rtcfd and its executor of "
            "the same version",
            errors_pb2.REASON_REQUEST_MALFORMED,
        )
    has, needed = Level(runner.settings().ros.peers), _NEEDED[kind]
    if has < needed:
        raise FailedPrecondition(
            f"ROS peers have {'no right' if has == Level.NONE else f'the right {has.word}'} on "
            f"runner {runner.name}, and `{kind}` requires {needed.word}: grant it with "
            f"rtcfctl runner set {runner.name} --ros-peers {needed.word}, or use "
            f"rtcfctl -r {runner.name} {kind}",
            errors_pb2.REASON_RIGHT_MISSING,
            right=needed.word,
        )
    return str(kind)


async def _change(runner: RunnerCore, call: wire.ServiceCall) -> control_pb2.ChangeResult:
    kind = call.WhichOneof("kind")
    if kind == "load":
        return await graph.load(runner, control_pb2.LoadRequest(component=call.load), _ignore)
    if kind == "unload":
        request = control_pb2.UnloadRequest(components=[call.unload])
        return await graph.unload(runner, request, _ignore)
    if kind == "start":
        return await start(runner, control_pb2.StartRequest(), _ignore)
    return await stop(runner, _ignore)


def _ignore(_line: str) -> None:
    """Discard a line of progress."""
