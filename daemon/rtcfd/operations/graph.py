"""Changes of a runner's graph.

Functions on a RunnerCore; each is one Change, and one transaction of its executor.
"""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Iterable, Mapping

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2, graph_pb2
from rtcf_shared.graph_writer import same_value
from rtcf_shared.naming import listing

from rtcfd.access import caller
from rtcfd.access.caller import Caller
from rtcfd.catalog.catalog import loads, whole_graph
from rtcfd.common import declared_values, runner_settings
from rtcfd.common.errors import InvalidArgument, NoMaster, NotFound, RequestError
from rtcfd.common.names import absolute, check_graph, full_name
from rtcfd.executor.link import Progress
from rtcfd.operations import parameters, tuned
from rtcfd.operations.runner_core import Change, RunnerCore, no_component
from rtcfd.state.desired import replacement

_MASTER_POLL_S = 0.5


async def load(
    runner: RunnerCore, request: control_pb2.LoadRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Load a component; with `wait`, if its hooks need a ROS master and there is none, wait for
    one."""
    if request.wait:
        return await when_master(lambda: _load(runner, request.component, progress), progress)
    return await _load(runner, request.component, progress)


async def _load(
    runner: RunnerCore, spec: graph_pb2.ComponentSpec, progress: Progress
) -> control_pb2.ChangeResult:
    library = await runner.shared.catalog.find(spec.package, spec.type)
    library.set_vector_sizes(spec)
    note = library.note(spec)
    acting = caller.current()
    desired, code = runner.desired, f"{spec.package}/{spec.type}"

    async def request() -> wire.Request:
        runner.shared.limits.check_components(len(desired.components) + 1)
        return wire.Request(load=library.load(spec))

    def commit(result: control_pb2.ChangeResult) -> None:
        desired.left_out.pop(result.component, None)
        desired.put(result.component, spec)
        parameters.note(runner, result.component, spec.parameters, {}, acting, "load")

    result = await runner.make(
        Change(
            name=f"the load of {code}",
            request=request,
            event=lambda result: f"{result.component} loaded ({code})",
            commit=commit,
        ),
        progress,
    )
    if note:
        runner.log.warning(note)
        result.notes.append(note)
    return result


async def when_master(
    attempt: Callable[[], Awaitable[control_pb2.ChangeResult]], progress: Progress
) -> control_pb2.ChangeResult:
    """Repeat a load while its hooks need a ROS master and there is none."""
    said = ""
    while True:
        try:
            return await attempt()
        except NoMaster as error:
            if str(error) != said:
                said = str(error)
                progress(f"waiting for a ROS master: {said}")
        # Outside of the turn, so that other changes can take theirs.
        await asyncio.sleep(_MASTER_POLL_S)


async def unload(
    runner: RunnerCore,
    request: control_pb2.UnloadRequest,
    progress: Progress,
    patient: bool = False,
) -> control_pb2.ChangeResult:
    """Unload components.

    If a component is left out, or its executor is down, only the saved graph changes.
    So a component that crashes its executor can be removed.
    """
    if not request.components:
        raise InvalidArgument(
            "name the components to unload", errors_pb2.REASON_NAME_MISSING, field="components"
        )
    names = [absolute(name) for name in request.components]
    listed = ", ".join(names)

    async def unload_request() -> wire.Request | control_pb2.ChangeResult:
        live = [name for name in names if name not in runner.desired.left_out]
        if runner.up and live:
            return wire.Request(unload=control_pb2.UnloadRequest(components=live))
        require_known(runner, names)
        return control_pb2.ChangeResult(notes=["removed from the saved graph only"])

    return await runner.make(
        Change(
            name=f"the unload of {listed}",
            request=unload_request,
            event=lambda _: f"{listed} unloaded",
            commit=lambda _: runner.desired.drop(names),
            component=_single(names),
            patient=patient,
        ),
        progress,
    )


async def replace(
    runner: RunnerCore, request: control_pb2.ReplaceRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Replace a component by a new one.

    Parameters that the request does not name keep their values; with `given_before`, only those
    do that were tuned since (see tuned.py).
    """
    old, given = absolute(request.component), request.replacement
    before = runner.desired.components.get(old)
    package = given.package or (before.package if before else "")
    type_name = given.type or (before.type if before else "")
    library = await runner.shared.catalog.find(package, type_name)
    acting = caller.current()
    code = f"{package}/{type_name}"
    spec = graph_pb2.ComponentSpec()
    kept: tuned.Tuned | None = None
    values: dict[str, graph_pb2.ParameterValue] = {}  # before

    async def replace_request() -> wire.Request:
        nonlocal kept
        await parameters.settle_lists(runner, old)
        values.clear()
        with contextlib.suppress(RequestError, KeyError):  # then the request fails, too
            values.update(await parameters.values_of(runner, old))
        spec.CopyFrom(replacement(runner.desired.components.get(old), given))
        library.set_vector_sizes(spec)
        if request.HasField("given_before"):
            kept = await tuned.keep(runner, old, spec, request.given_before)
        reset = request.reset_parameters or kept is not None
        if old in runner.desired.left_out:  # the executor does not have it
            load = library.load(spec)
            if not reset:
                inherited = graph_pb2.ComponentSpec()
                inherited.CopyFrom(runner.desired.components[old])
                with contextlib.suppress(RequestError):  # the old type had other vectors
                    library.set_vector_sizes(inherited)
                load.inherited.extend(inherited.parameters)
            return wire.Request(load=load)
        return wire.Request(
            replace=wire.Replace(
                component=old,
                replacement=spec,
                library=library.path,
                owner=library.owner,
                reset_parameters=reset,
            )
        )

    def commit(result: control_pb2.ChangeResult) -> None:
        set_now = [
            each
            for each in spec.parameters
            if each.name not in values or not same_value(values[each.name], each.value)
        ]
        spec.parameters.extend(result.kept)
        runner.desired.drop([old])
        runner.desired.put(result.component, spec)
        if kept is None:
            parameters.note(runner, result.component, set_now, values, acting, "replace")
        else:
            kept.note(runner, result.component, acting, "replace")
            kept.add_to(result)

    return await runner.make(
        Change(
            name=f"the replacement of {old} by {code}",
            request=replace_request,
            event=lambda result: f"{old} replaced by {result.component} ({code})",
            commit=commit,
        ),
        progress,
    )


async def release(
    runner: RunnerCore, request: control_pb2.ReleaseRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Load components again that are left out of the loop, or are marked as faulted in it."""
    if not request.components:
        raise InvalidArgument(
            "name the components to release", errors_pb2.REASON_NAME_MISSING, field="components"
        )
    names = [absolute(name) for name in request.components]
    listed = ", ".join(names)

    async def release_request() -> wire.Request:
        require_known(runner, names)
        for name in names:
            await parameters.settle_lists(runner, name)
        marked = [name for name in names if name not in runner.desired.left_out]
        if marked:
            await _require_faulted(runner, marked)
        specs = [runner.desired.components[name] for name in names]
        if len(specs) == 1 and not marked:
            (load,) = await loads(runner.shared.catalog, specs)
            return wire.Request(load=load)
        every = [spec for name, spec in runner.desired.components.items()
                 if name not in runner.desired.left_out or name in names]  # fmt: skip
        apply = await whole_graph(runner.shared.catalog, every)
        for load in apply.components:
            load.anew = full_name(load.component) in marked
        return wire.Request(apply=apply)

    def commit(_: control_pb2.ChangeResult) -> None:
        for name in names:
            runner.desired.left_out.pop(name, None)
            runner.desired.quarantined.pop(name, None)

    return await runner.make(
        Change(
            name=f"the release of {listed}",
            request=release_request,
            event=lambda _: f"{listed} released",
            commit=commit,
            component=_single(names),
        ),
        progress,
    )


async def _require_faulted(runner: RunnerCore, names: list[str]) -> None:
    """Raise NotFound if a component of the loop is not faulted."""
    listed = await runner.ask(wire.Request(list_components=wire.ListComponents()))
    faulted = {
        str(each.full_name)
        for each in listed.components.components
        if each.state == graph_pb2.COMPONENT_STATE_FAULTED
    }
    for name in names:
        if name not in faulted:
            raise NotFound(
                f"{name} is not left out of runner {runner.name}: it is in the loop",
                errors_pb2.REASON_COMPONENT_NOT_LEFT_OUT,
                component=name,
            )


async def apply(
    runner: RunnerCore, request: control_pb2.ApplyRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Change the graph, and the given settings, to those of a request."""
    check_graph(request.components)
    runner_settings.check(request.settings)
    runner.shared.limits.check_components(len(request.components))
    acting = caller.current()
    specs = list(request.components)
    kept: dict[str, tuned.Tuned] = {}

    async def result_of_apply() -> control_pb2.ChangeResult:
        if request.given_before:
            kept.update(await tuned.keep_all(runner, specs, request.given_before))
        result = await _ask_to_apply(runner, request, specs, kept, progress)
        if not request.dry_run:
            changed = (each for each in specs if full_name(each) not in kept)
            await _note_parameters(runner, changed, acting)
            for name, each in kept.items():
                each.note(runner, name, acting, "apply")
        return result

    def commit(_: control_pb2.ChangeResult) -> None:
        runner.desired.become(specs)
        runner.desired.left_out.clear()
        runner.desired.choose(request.settings)

    name = "the application of a graph"
    if request.dry_run:
        return await runner.change(name, result_of_apply)
    return await runner.make(
        Change(
            name=name,
            request=result_of_apply,
            event=lambda result: (
                f"graph applied; components: {len(specs)}, differences: {len(result.differences)}"
            ),
            commit=commit,
            component="",
        ),
        progress,
    )


async def _ask_to_apply(
    runner: RunnerCore,
    request: control_pb2.ApplyRequest,
    specs: list[graph_pb2.ComponentSpec],
    kept: Mapping[str, tuned.Tuned],
    progress: Progress,
) -> control_pb2.ChangeResult:
    """Make the executor apply a graph and settings, or neither."""
    before = runner.settings()
    changes = runner_settings.differences(before, request.settings)
    apply = await whole_graph(runner.shared.catalog, specs, dry_run=True)
    for spec, load in zip(specs, apply.components, strict=True):
        if spec.lists:
            spec.CopyFrom(load.component)
    rebuilt = await runner.code.changed()
    for load in apply.components:
        load.anew = request.rebuilt and full_name(load.component) in rebuilt
    if not request.dry_run and (changes or not request.runner):
        # A dry run first, so that a rejected graph does not change the settings, not even for
        # a moment.
        would = (await runner.ask(wire.Request(apply=apply), progress)).change
        if not request.runner:
            _require_no_unload(runner, would)
    if changes and not request.dry_run:
        effect = runner.desired.effect(request.settings, runner.shared.defaults)
        await runner.ask(wire.Request(configure=effect))
    apply.dry_run = request.dry_run
    try:
        result = (await runner.ask(wire.Request(apply=apply), progress)).change
    except RequestError:
        if changes and not request.dry_run and runner.up:
            await runner.ask(wire.Request(configure=before))
        raise
    for text in changes:
        kind = control_pb2.Difference.KIND_SETTINGS
        result.differences.append(control_pb2.Difference(kind=kind, detail=text))
    for name, each in kept.items():
        result.notes.extend(each.notes)
        if each.kept:
            words = ", ".join(
                f"{one.name} = {declared_values.word(one.value)}" for one in each.kept
            )
            result.notes.append(f"{name} keeps {words}, set since")
    stale = sorted({full_name(each) for each in request.components} & rebuilt.keys())
    if stale and not request.rebuilt:
        result.notes.append(
            f"the library of {', '.join(stale)} has changed since it was loaded: "
            "--rebuilt loads the new one"
        )
    return result


def _require_no_unload(runner: RunnerCore, would: control_pb2.ChangeResult) -> None:
    """Raise InvalidArgument if a change removes components from a runner that it does not name."""
    kind = control_pb2.Difference.KIND_UNLOAD
    leaving = [each.component for each in would.differences if each.kind == kind]
    if leaving:
        raise InvalidArgument(
            f"this graph would unload {listing(leaving)} from runner {runner.name}, which it does "
            "not name: name the runner, in the file or by --runner",
            errors_pb2.REASON_NAME_MISSING,
            runner=runner.name,
            field="runner",
        )


def left_out(runner: RunnerCore) -> list[graph_pb2.ComponentInfo]:
    """Return the components of the graph that are not loaded, with the reason."""
    return [
        graph_pb2.ComponentInfo(
            full_name=name,
            spec=runner.desired.components[name],
            state=graph_pb2.COMPONENT_STATE_LEFT_OUT,
            fault=reason,
        )
        for name, reason in sorted(runner.desired.left_out.items())
    ]


async def mark_stuck(runner: RunnerCore, found: list[graph_pb2.ComponentInfo]) -> None:
    """Mark the component of a hook that does not return; add it if the graph does not have it."""
    stuck = await runner.stuck()
    if stuck is None:
        return
    if all(each.full_name != stuck.component for each in found):
        found.append(graph_pb2.ComponentInfo(full_name=stuck.component))
    for each in found:
        if each.full_name == stuck.component:
            each.state = graph_pb2.COMPONENT_STATE_STUCK
            each.fault = (
                f"its {stuck.hook}() has not returned for {stuck.duration_s:.0f} s: see `rtcfctl "
                "status`"
            )


async def set_breaks(
    runner: RunnerCore, request: control_pb2.SetBreaksRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Set or remove loop breaks."""
    changed: dict[str, graph_pb2.ComponentSpec] = {}

    async def result_of_change() -> control_pb2.ChangeResult:
        result = (await runner.ask(wire.Request(set_breaks=request), progress)).change
        for name in {absolute(port.component) for port in request.ports}:
            changed[name] = (await parameters.live_component(runner, name)).spec
        return result

    def commit(_: control_pb2.ChangeResult) -> None:
        for name, live in changed.items():
            runner.desired.set_breaks(name, live)

    ports = ", ".join(f"{absolute(port.component)}.{port.port}" for port in request.ports)
    text = f"{ports}: loop break {'set' if request.broken else 'removed'}"
    return await runner.make(
        Change(
            name="a change of loop breaks",
            request=result_of_change,
            event=lambda _: text,
            commit=commit,
            component="",
        ),
        progress,
    )


async def _note_parameters(
    runner: RunnerCore, specs: Iterable[graph_pb2.ComponentSpec], acting: Caller | None
) -> None:
    """Note the parameters that a graph has changed."""
    for spec in specs:
        name = full_name(spec)
        await parameters.settle_lists(runner, name)
        before = runner.desired.components.get(name)
        known = {} if before is None else {each.name: each.value for each in before.parameters}
        now = {each.name: each.value for each in spec.parameters}
        if before is not None and now != known:
            # A parameter that the graph does not set has its default.
            with contextlib.suppress(RequestError):
                library = await runner.shared.catalog.find(spec.package, spec.type)
                defaults = {each.name: each.default_value for each in library.parameters}
                known, now = defaults | known, defaults | now
        changed = [
            graph_pb2.ParameterSetting(name=each, value=value)
            for each, value in now.items()
            if each not in known or not same_value(known[each], value)
        ]
        quiet = before is None  # a new component, perhaps one of a thousand
        parameters.note(runner, name, changed, known, acting, "apply", quiet=quiet)


async def reset_state(
    runner: RunnerCore, request: control_pb2.ResetStateRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Reset the state of one component to its initial values."""
    name = absolute(request.component)
    return await runner.make(
        Change(
            name=f"a reset of {name}",
            request=wire.Request(reset_state=request),
            event=lambda _: f"{name}: state reset",
            kind=control_pb2.Event.KIND_PARAMETERS,
            component=name,
        ),
        progress,
    )


async def set_state(
    runner: RunnerCore, request: control_pb2.SetStateRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Set state values of one component while the loop does not run."""
    name = absolute(request.component)
    states = ", ".join(each.name for each in request.states)
    return await runner.make(
        Change(
            name=f"a change of the state of {name}",
            request=wire.Request(set_state=request),
            event=lambda _: f"{name}: state {states} set by {caller.name()}",
            kind=None,
        ),
        progress,
    )


def _single(names: list[str]) -> str:
    """Return the name of the only component of a change; empty = there are several."""
    return names[0] if len(names) == 1 else ""


def require_known(runner: RunnerCore, full_names: Iterable[str]) -> None:
    """Raise NotFound if a component is not in the saved graph."""
    for name in full_names:
        if name not in runner.desired.components:
            raise no_component(runner, name)
