"""Changes of parameters, by clients and ROS peers; their history; undo.  Writes to inputs.

Functions on a RunnerCore; each is one transaction of its executor.
"""

import asyncio
import contextlib
import time
from collections.abc import Iterable, Mapping
from ctypes import c_float

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2, graph_pb2
from rtcf_shared.graph_writer import same_value

from rtcfd.access import caller
from rtcfd.access.caller import Caller
from rtcfd.access.rights import require_pace
from rtcfd.common import declared_values, ros_value
from rtcfd.common.declared_values import plain, word
from rtcfd.common.errors import FailedPrecondition, InvalidArgument, NotFound, RequestError
from rtcfd.common.names import absolute
from rtcfd.executor.link import Progress
from rtcfd.operations.runner_core import Change, PendingParameters, RunnerCore, no_component
from rtcfd.state.desired import ComponentLeaseTerms
from rtcfd.state.history import MOST_OF_A_COMPONENT, UNANSWERED, ParameterChange

_MOST_CHANGES = 500  # in one response
_MOST_BYTES = 2 * 1024 * 1024  # in one response; other gRPC clients accept 4 MiB

Settings = Iterable[graph_pb2.ParameterSetting]


async def set_parameters(
    runner: RunnerCore, request: control_pb2.SetParametersRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Change parameters of one component."""
    name = absolute(request.component)
    if not request.parameters and not request.lists:
        raise InvalidArgument(
            f"{name}: no parameter is given: name one and its value, as in kp:=2.0",
            errors_pb2.REASON_NAME_MISSING,
            component=name,
            field="parameters",
        )
    # Looked up here: the turn may begin in the context of another call.
    acting = caller.current()

    async def work() -> control_pb2.ChangeResult:
        if request.lists:
            declared_values.set_vector_sizes(name, request, await _declared(runner, name))
        lease = _lease(runner, absolute(request.undo_with)) if request.undo_with else None
        return await _set(runner, name, list(request.parameters), acting, progress, lease=lease)

    return await runner.change(f"a change of parameters of {name}", work)


async def undo(
    runner: RunnerCore, request: control_pb2.UndoParametersRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Undo the last change of one component; repeated, the change before that."""
    name = absolute(request.component)
    acting = caller.current()

    async def work() -> control_pb2.ChangeResult:
        last = runner.desired.history.to_take_back(name)
        if not last:
            raise FailedPrecondition(
                f"no change of parameters of {name} in runner {runner.name} is left to undo: "
                f"`rtcfctl -r {runner.name} history {name}` lists all changes",
                errors_pb2.REASON_NOTHING_TO_UNDO,
                component=name,
            )
        return await _undo(runner, name, last, acting, progress)

    return await runner.change(f"an undo of parameters of {name}", work)


async def undo_with(runner: RunnerCore, lease: ComponentLeaseTerms, why: str) -> None:
    """Undo the changes that last only with a lease, newest first; errors are logged.

    A change that is undone, or that another one of its component followed, stays.
    """

    async def work() -> None:
        while lease.changes:
            name, number = lease.changes.pop()
            last = runner.desired.history.to_take_back(name)
            if not last or last[0].number != number:
                continue
            runner.log.warning("%s: %s: its last change is undone", name, why)
            try:
                await _undo(runner, name, last, None, lambda _: None)
            except RequestError as error:
                runner.log.error("%s", error)

    try:
        # Also without changes so far: one may be running.
        await runner.change("an undo of parameters", work, patient=True)
    except RequestError as error:
        runner.log.error("%s", error)


async def write_input(
    runner: RunnerCore, request: control_pb2.WritePortRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Write a value to an input at the next cycle boundary; it is not saved."""
    name = absolute(request.component)
    port = {"component": name, "port": request.port}

    async def write_request() -> wire.Request:
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
        return wire.Request(write_input=wire.WriteInput(message=message, **port))

    return await runner.make(
        Change(
            name=f"a value of {name}.{request.port}",
            request=write_request,
            event=lambda _: f"{name}: input {request.port} written by {caller.name()}",
            kind=None,
        ),
        progress,
    )


def history(
    runner: RunnerCore, request: control_pb2.GetHistoryRequest
) -> control_pb2.GetHistoryResponse:
    """Return the newest changes that match a request, in order, oldest first."""
    component = absolute(request.component) if request.component else ""
    found = runner.desired.history.of(component, request.parameter)
    if component and not found and component not in runner.desired.components:
        raise no_component(runner, component, ", and no change of one")
    most = min(request.most or _MOST_CHANGES, _MOST_CHANGES)
    changes: list[control_pb2.ParameterChange] = []
    room = _MOST_BYTES
    for each in reversed(found[-most:]):
        change = change_message(each)
        room -= change.ByteSize() + 8  # 8: the tag and the length of the field
        if room < 0 and changes:
            break
        changes.append(change)
    return control_pb2.GetHistoryResponse(changes=reversed(changes))


def change_message(change: ParameterChange) -> control_pb2.ParameterChange:
    """Return a change as the client protocol has it."""
    return control_pb2.ParameterChange(
        component=change.component,
        parameter=change.parameter,
        before=change.before,
        value=change.value,
        time_ns=change.time_ns,
        who=change.who,
        how=change.how,
    )


async def follow_ros(runner: RunnerCore, changed: Mapping[str, set[str]]) -> None:
    """Note parameters that ROS peers have changed; `changed` has their names, by component."""
    for component, names in changed.items():
        # Ask for the current values: they may have changed again.
        with contextlib.suppress(NotFound):  # the component was unloaded meanwhile
            found = await live_component(runner, component)
            known = _last_values(runner, found.full_name, found.parameters)
            settings = [
                graph_pb2.ParameterSetting(name=each.name, value=each.value)
                for each in found.parameters
                if each.name in names
            ]
            runner.desired.set_parameters(component, settings)
            note(runner, component, settings, known, None, "dynamic_reconfigure")


def note_unanswered(runner: RunnerCore) -> None:
    """Note the `set` that was running when an executor died: it may be the cause."""
    pending, runner.pending_parameters = runner.pending_parameters, []
    for each in pending:
        note(runner, each.component, each.settings, each.before, each.acting, UNANSWERED)


def note(
    runner: RunnerCore,
    component: str,
    settings: Settings,
    before: Mapping[str, graph_pb2.ParameterValue],
    acting: Caller | None,
    how: str,
    author: str = "",
    takes_back: int = 0,
    quiet: bool = False,
) -> int:
    """Note a change of parameters and its author: in the history and, unless `quiet` (for new
    components of a graph), in the log and the events.

    `author` overrides the caller; `takes_back` is the number of the change that this one undoes.
    Returns the number of the change, 0 without `settings`.
    """
    settings = list({each.name: each for each in settings}.values())
    if not settings:
        return 0
    author = author or _who(acting, how)
    number = runner.desired.history.note(
        component,
        [(each.name, before.get(each.name), each.value) for each in settings],
        author,
        how,
        takes_back,
    )
    if quiet:
        return number
    words = ", ".join(f"{each.name} = {word(each.value)}" for each in settings)
    deed = "restored" if takes_back else "set"
    if how == UNANSWERED:
        deed = "set (the executor died before its response)"
    runner.happened(
        control_pb2.Event.KIND_PARAMETERS, f"{component}: {words} {deed}", component, user=author
    )
    runner.log.logger.info(
        "%s: %s %s by %s",
        component,
        words,
        deed,
        author if how == "set" or takes_back else f"{author}, {how}",
        extra={"runner": runner.name, "peer": None if acting is None else acting.peer},
    )
    return number


def _lease(runner: RunnerCore, component: str) -> ComponentLeaseTerms:
    """Return the terms of a lease; raises NotFound."""
    terms = runner.desired.leased.get(component)
    if terms is None:
        raise NotFound(
            f"{component} is not leased in runner {runner.name}: lease it before the change, or "
            "omit undo_with",
            errors_pb2.REASON_LEASE_NOT_FOUND,
            component=component,
        )
    return terms


async def _undo(
    runner: RunnerCore,
    name: str,
    last: list[ParameterChange],
    acting: Caller | None,
    progress: Progress,
) -> control_pb2.ChangeResult:
    now = await values_of(runner, name)
    settings = [_taken_back(runner, each, now) for each in last]
    result = await _set(runner, name, settings, acting, progress, last[0].number)
    words = ", ".join(f"{each.name} = {word(each.value)}" for each in settings)
    result.notes.append(f"{words}, as before {last[0].who} changed it")
    return result


async def _set(
    runner: RunnerCore,
    name: str,
    settings: list[graph_pb2.ParameterSetting],
    acting: Caller | None,
    progress: Progress,
    takes_back: int = 0,
    lease: ComponentLeaseTerms | None = None,
) -> control_pb2.ChangeResult:
    await settle_lists(runner, name)
    before = await values_of(runner, name)
    if acting is not None and acting.tuning is not None:
        _require_tuning(runner, name, settings, before, acting)
    if name in runner.desired.left_out:
        result = await _check_left_out(runner, name, settings)
    else:
        result = await _ask(runner, PendingParameters(name, settings, before, acting), progress)
        with contextlib.suppress(RequestError):  # its executor has died meanwhile
            settings = _adopted(settings, await values_of(runner, name))
    runner.desired.set_parameters(name, settings)
    how = "undo" if takes_back else "set"
    number = note(runner, name, settings, before, acting, how, "", takes_back)
    if lease is not None:
        lease.changes.append((name, number))
        del lease.changes[:-MOST_OF_A_COMPONENT]
    result.notes.extend(await runner.save())
    return result


def _adopted(
    settings: Settings, values: Mapping[str, graph_pb2.ParameterValue]
) -> list[graph_pb2.ParameterSetting]:
    """Return settings with the values that the component has: in their types, rounded to them."""
    return [
        graph_pb2.ParameterSetting(name=each.name, value=values.get(each.name, each.value))
        for each in settings
    ]


async def _ask(
    runner: RunnerCore, pending: PendingParameters, progress: Progress
) -> control_pb2.ChangeResult:
    request = control_pb2.SetParametersRequest(
        component=pending.component, parameters=pending.settings
    )
    runner.pending_parameters.append(pending)
    try:
        return (await runner.ask(wire.Request(set_parameters=request), progress)).change
    finally:
        if pending in runner.pending_parameters:
            runner.pending_parameters.remove(pending)


async def _check_left_out(
    runner: RunnerCore, name: str, settings: list[graph_pb2.ParameterSetting]
) -> control_pb2.ChangeResult:
    """Check parameters for a component that is left out: it gets them when it is loaded again."""
    declared = {each.name: each for each in await _of_type(runner, name)}
    for each in settings:
        declared_values.check(name, each, declared)
    result = control_pb2.ChangeResult(component=name)
    result.notes.append(
        f"{name} is left out of the loop: `rtcfctl -r {runner.name} release {name}` loads it with "
        "these values"
    )
    return result


def _taken_back(
    runner: RunnerCore, change: ParameterChange, now: Mapping[str, graph_pb2.ParameterValue]
) -> graph_pb2.ParameterSetting:
    """Return the setting that undoes a change.

    Raises FailedPrecondition if there is no earlier value, or if the parameter has changed since.
    """
    name = f"{change.component}.{change.parameter}"
    if change.before is None:
        raise FailedPrecondition(
            f"{name} came with the component ({change.how} by {change.who}): there is no earlier "
            f"value to restore; `rtcfctl -r {runner.name} set` sets another value",
            errors_pb2.REASON_NOTHING_TO_UNDO,
            component=change.component,
            parameter=change.parameter,
        )
    found = now.get(change.parameter)
    if found is None or not _is_adopted(found, change.value):
        raise FailedPrecondition(
            f"{name} is {'gone' if found is None else word(found)}, not "
            f"{word(change.value)} as {change.who} set it: it was changed otherwise since; "
            f"`rtcfctl -r {runner.name} set` sets another value",
            errors_pb2.REASON_NOTHING_TO_UNDO,
            component=change.component,
            parameter=change.parameter,
        )
    return graph_pb2.ParameterSetting(name=change.parameter, value=change.before)


def _is_adopted(found: graph_pb2.ParameterValue, given: graph_pb2.ParameterValue) -> bool:
    """Return whether a component has a value that was given to it, perhaps in single precision."""
    if same_value(found, given):
        return True
    number = plain(given)
    if not isinstance(number, int | float) or isinstance(number, bool):
        return False
    return same_value(found, graph_pb2.ParameterValue(double_value=c_float(number).value))


def _require_tuning(
    runner: RunnerCore,
    component: str,
    changes: Settings,
    values: Mapping[str, graph_pb2.ParameterValue],
    acting: Caller,
) -> None:
    """Raise PermissionDenied or FailedPrecondition if the rules that bind the caller forbid a
    change, or one that fast."""
    assert acting.tuning is not None
    now = time.monotonic()
    tuned = {}
    for each in changes:
        name = f"{component}.{each.name}"
        rule = acting.tuning.rule(runner.name, name)
        if each.name in values:  # else the component rejects it
            last = runner.tuned.get(name)
            require_pace(rule, name, plain(values[each.name]), plain(each.value), last, now)
            tuned[name] = now
    there = runner.desired.components
    runner.tuned = {
        name: at for name, at in runner.tuned.items() if name.rpartition(".")[0] in there
    } | tuned


async def settle_lists(runner: RunnerCore, name: str) -> None:
    """Set the sizes of vectors of a component that is left out, if its type is known by now."""
    spec = runner.desired.components.get(name)
    if spec is not None and spec.lists:
        with contextlib.suppress(RequestError):
            library = await runner.shared.catalog.find(spec.package, spec.type)
            runner.desired.settle(name, library.load(spec).component)


async def live_component(runner: RunnerCore, name: str) -> graph_pb2.ComponentInfo:
    """Return one component, as it is in the executor."""
    query = wire.Request(get_component=control_pb2.GetComponentRequest(component=name))
    found: graph_pb2.ComponentInfo = (await runner.ask(query)).component
    return found


async def live_components(runner: RunnerCore) -> dict[str, graph_pb2.ComponentInfo]:
    """Return all components, as they are in the executor, by full name."""
    listed = await runner.ask(wire.Request(list_components=wire.ListComponents()))
    return {str(each.full_name): each for each in listed.components.components}


async def _declared(runner: RunnerCore, name: str) -> list[graph_pb2.ParameterInfo]:
    """Return the declared parameters of a component."""
    if name in runner.desired.left_out:
        return await _of_type(runner, name)
    return list((await live_component(runner, name)).parameters)


async def _of_type(runner: RunnerCore, name: str) -> list[graph_pb2.ParameterInfo]:
    """Return the parameters that the type of a left-out component declares."""
    spec = runner.desired.components[name]
    return list((await runner.shared.catalog.find(spec.package, spec.type)).parameters)


async def values_of(runner: RunnerCore, name: str) -> dict[str, graph_pb2.ParameterValue]:
    """Return the present values of a component's parameters, in their declared types."""
    declared = await _declared(runner, name)
    if name in runner.desired.left_out:
        return _last_values(runner, name, declared)
    return {each.name: each.value for each in declared}


def _last_values(
    runner: RunnerCore, name: str, declared: Iterable[graph_pb2.ParameterInfo]
) -> dict[str, graph_pb2.ParameterValue]:
    """Return the last known values of a component's parameters."""
    values = {each.name: each.default_value for each in declared}
    spec = runner.desired.components.get(name)
    if spec is not None:
        values.update({each.name: each.value for each in spec.parameters})
    return values


def _who(acting: Caller | None, how: str) -> str:
    if how == "dynamic_reconfigure":
        return "a ROS peer"
    return "rtcfd" if acting is None else acting.peer.user
