"""Writes values to inputs without a writer.  Functions on a RunnerCore."""

import asyncio

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2

from rtcfd.access import caller
from rtcfd.common import ros_value
from rtcfd.common.names import absolute
from rtcfd.common.refusals import InvalidArgument
from rtcfd.executor.link import Progress
from rtcfd.operations.runner_core import RunnerCore


async def write(
    runner: RunnerCore, request: control_pb2.WritePortRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Write a value to an input at the next cycle boundary; it is not saved."""
    name = absolute(request.component)
    port = {"component": name, "port": request.port}

    async def work() -> control_pb2.ChangeResult:
        asked = await runner.ask(wire.Request(describe_input=wire.DescribeInput(**port)))
        found = asked.input_type
        try:
            # In a thread, because the YAML parser is slow.
            message = await asyncio.to_thread(ros_value.encode, found.ros_definition, request.value)
        except ValueError as error:
            raise InvalidArgument(
                f"{name}.{request.port} takes {found.ros_type}: {error}",
                errors_pb2.REASON_VALUE_INVALID,
                field="value",
            ) from None
        written = wire.WriteInput(message=message, **port)
        return (await runner.ask(wire.Request(write_input=written), progress)).change

    result = await runner.change(f"a value of {name}.{request.port}", work)
    runner.log.info("%s: input %s written by %s", name, request.port, caller.name())
    return result
