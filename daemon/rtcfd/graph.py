"""Changes of a runner's graph: the executor adopts, then rtcfd notes and saves.

Functions on a Runner; each is one transaction of its executor.
"""

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, graph_pb2

from rtcfd.desired import replacement
from rtcfd.errors import InvalidArgument, NotFound
from rtcfd.link import Progress
from rtcfd.names import absolute, listing, suggestion
from rtcfd.runner import Runner


async def load(
    runner: Runner, spec: graph_pb2.ComponentSpec, progress: Progress
) -> control_pb2.ChangeResult:
    """Load a component."""
    library = await runner.library(spec.package, spec.type)

    async def work() -> control_pb2.ChangeResult:
        request = wire.Request(load=wire.Load(component=spec, library=library))
        result = (await runner.ask(request, progress)).change
        runner.left_out.pop(result.component, None)
        runner.desired.put(result.component, spec)
        return await _saved(runner, result)

    what = f"{spec.package}/{spec.type}"
    result = await runner.change(f"the load of {what}", work)
    runner.log.info("%s loaded (%s)", result.component, what)
    return result


async def unload(runner: Runner, names: list[str], progress: Progress) -> control_pb2.ChangeResult:
    """Unload components.

    Those that were left out, or belong to an executor that is down, are only
    forgotten: so a component that breaks its executor can be taken out.
    """
    if not names:
        raise InvalidArgument("no component named to unload")
    full_names = [absolute(name) for name in names]

    async def work() -> control_pb2.ChangeResult:
        live = [name for name in full_names if name not in runner.left_out]
        if runner.up and live:
            request = wire.Request(unload=control_pb2.UnloadRequest(components=live))
            result = (await runner.ask(request, progress)).change
        else:
            _check_known(runner, full_names)
            result = control_pb2.ChangeResult(notes=["taken out of the saved graph only"])
        for name in full_names:
            runner.left_out.pop(name, None)
        runner.desired.drop(full_names)
        return await _saved(runner, result)

    what = ", ".join(full_names)
    result = await runner.change(f"the unload of {what}", work)
    runner.log.info("%s unloaded", what)
    return result


async def replace(
    runner: Runner, name: str, given: graph_pb2.ComponentSpec, progress: Progress
) -> control_pb2.ChangeResult:
    """Put a new component in the place of an old one."""
    old = absolute(name)
    library = await runner.library(given.package, given.type)

    async def work() -> control_pb2.ChangeResult:
        spec = replacement(runner.desired.components.get(old), given)
        change = wire.Replace(component=old, replacement=spec, library=library)
        result = (await runner.ask(wire.Request(replace=change), progress)).change
        runner.desired.drop([old])
        runner.desired.put(result.component, spec)
        return await _saved(runner, result)

    what = f"{given.package}/{given.type}"
    result = await runner.change(f"the replacement of {old} by {what}", work)
    runner.log.info("%s replaced by %s (%s)", old, result.component, what)
    return result


async def set_breaks(
    runner: Runner, request: control_pb2.SetBreaksRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Set or remove loop breaks."""

    async def work() -> control_pb2.ChangeResult:
        result = (await runner.ask(wire.Request(set_breaks=request), progress)).change
        runner.desired.set_breaks(request.ports, request.broken)
        return await _saved(runner, result)

    result = await runner.change("a change of loop breaks", work)
    ports = ", ".join(f"{absolute(port.component)}.{port.port}" for port in request.ports)
    runner.log.info("%s: loop break %s", ports, "set" if request.broken else "removed")
    return result


async def set_parameters(
    runner: Runner, request: control_pb2.SetParametersRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Change parameters of one component."""
    name = absolute(request.component)

    async def work() -> control_pb2.ChangeResult:
        result = (await runner.ask(wire.Request(set_parameters=request), progress)).change
        runner.desired.set_parameters(name, request.parameters)
        return await _saved(runner, result)

    result = await runner.change(f"a change of parameters of {name}", work)
    changed = ", ".join(setting.name for setting in request.parameters)
    runner.log.info("%s: %s set", name, changed)
    return result


async def _saved(runner: Runner, result: control_pb2.ChangeResult) -> control_pb2.ChangeResult:
    result.notes.extend(await runner.save())
    return result


def _check_known(runner: Runner, full_names: list[str]) -> None:
    known = runner.desired.components
    for name in full_names:
        if name not in known:
            raise NotFound(
                f"no component {name} in runner {runner.name}"
                f"{suggestion(name, known)} (components: {listing(known)})"
            )
