"""Brings up a runner's executor with its graph.

If the executor is adopted, the desired state follows it; a new executor gets the desired
graph, without the components that crash.py left out.  Functions on a RunnerCore; each runs in a
turn of it.
"""

from collections.abc import Container, Iterable

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2, graph_pb2, runner_pb2
from rtcf_shared.graph_writer import live_spec
from rtcf_shared.naming import listing

from rtcfd.catalog.catalog import loads, whole_graph
from rtcfd.common.errors import FailedPrecondition, InvalidArgument, RequestError
from rtcfd.operations.loop import start_in_turn, stop_adopted
from rtcfd.operations.runner_core import RunnerCore
from rtcfd.recovery.follow import follow_components, follow_settings

_WORDS = {
    runner_pb2.RUNNER_STATE_STOPPED: "stopped",
    runner_pb2.RUNNER_STATE_RUNNING: "running",
    runner_pb2.RUNNER_STATE_FAULTED: "ended by a fault",
    runner_pb2.RUNNER_STATE_STUCK: "stuck",
    runner_pb2.RUNNER_STATE_STEPPING: "stepping",
}


async def bring_up(runner: RunnerCore, only_left_over: bool = False, boot: bool = False) -> bool:
    """Adopt a left-over executor, or start one (unless `only_left_over`), and load the graph.

    The loop is held; at `boot`, `on_boot` decides.  Returns whether there is an executor.
    """
    asked, stopped_at_ns = runner.loop.stops, runner.loop.stopped_at_ns
    agreed = set(runner.desired.left_out) if runner.loop.wanted else set()
    # Noted before: a direct stop that the executor reports may be older than the one that it owes.
    owed = runner.loop.stop_owed
    adopted = await runner.take_executor(only_left_over)
    if adopted is None:
        return False
    if adopted and (owed or runner.loop.stop_owed):
        runner.loop.stop_owed = True
        await stop_adopted(runner)
    executor = runner.executor
    if executor is not None and executor.foreign:
        # Its real state cannot be known.
        runner.loop.note_report(runner.loop.wanted or runner.loop.stop_owed)
        return True
    try:
        await runner.limit()
    except RequestError as error:
        if not adopted:
            raise
        runner.log.warning("%s", error)  # it keeps its earlier limits
    if adopted:
        # A direct stop that it reports on adoption is older than the state of its loop then.
        stopped = runner.loop.stopped_at_ns != stopped_at_ns
        await _follow(runner, asked + stopped)
    else:
        await _restore(runner)
    if boot:
        await _start_at_boot(runner, asked, agreed)
    runner.notify_change()
    return True


async def _follow(runner: RunnerCore, asked: int) -> None:
    """Make the desired state that of an adopted executor; `asked` is the number of stops that
    are older than the state of its loop.

    If the loop does not run, missing components are loaded: the previous rtcfd died
    while it restored the graph.
    """
    await _settle(runner)
    was_running = runner.loop.wanted
    request = wire.Request(get_status=wire.GetStatus())
    answer = await runner.ask(
        request, None, lambda answer: _note_status(runner, answer.status, asked)
    )
    status = answer.status
    listed = await runner.ask(wire.Request(list_components=wire.ListComponents()))
    await runner.begin_counting(reset=False)
    runner.log.info(
        "adopted: loop %s, iteration %d", _WORDS.get(status.state, "in an unknown state"),
        status.iteration,
    )  # fmt: skip
    lines = follow_settings(runner.desired, runner.shared.defaults, status.settings)
    leases_ended = _follow_leased(runner, listed.components.components)
    loop_stands = (runner_pb2.RUNNER_STATE_STOPPED, runner_pb2.RUNNER_STATE_STUCK)
    fresh = status.state in loop_stands and not status.iteration
    more, runner.desired.left_out = follow_components(
        runner.desired, listed.components.components, restored=not fresh
    )
    for line in lines + more:
        runner.log.warning("%s: the executor's is kept", line)
    if not runner.loop.running and was_running and not fresh:
        runner.loop.want(False)
    missing = [name for name in runner.desired.left_out if name not in runner.desired.quarantined]
    whole = True
    if fresh and status.stuck.component in missing:
        whole = not await _leave_out_stuck(runner)
    elif status.state == runner_pb2.RUNNER_STATE_STOPPED:
        whole = await _load_each(runner, missing)
    if not whole:
        await _restore(runner)
    if lines or more or leases_ended or runner.loop.wanted != was_running:
        await runner.save()
    runner.adopted()


def _note_status(runner: RunnerCore, status: runner_pb2.RunnerStatus, asked: int) -> None:
    """Note the state of a loop that an earlier rtcfd started; after a stop, it is not wanted."""
    running = status.state == runner_pb2.RUNNER_STATE_RUNNING
    runner.loop.note_report(running, None if runner.loop.stop_owed else asked)


def _follow_leased(runner: RunnerCore, found: Iterable[graph_pb2.ComponentInfo]) -> bool:
    """Take the specifications of leased components, which are not saved, from the executor.

    Returns whether it lacks one.
    """
    before = len(runner.desired.leased)
    live = {str(info.full_name): info for info in found}
    for name in list(runner.desired.leased):
        if name in live:
            runner.desired.put(name, live_spec(live[name]))
        else:
            runner.desired.drop([name])
    return len(runner.desired.leased) != before


async def _restore(runner: RunnerCore) -> None:
    """Load the desired components into a new executor; those that fail are left out and logged."""
    while not await _load_all(runner):
        pass  # the next executor lacks a component whose hook does not return
    desired = runner.desired
    if runner.up and desired.components:
        count = len(desired.components) - len(desired.left_out)
        runner.log.info("%d of its components restored, held", count)
    if desired.left_out:
        await runner.save()


async def _load_all(runner: RunnerCore) -> bool:
    """Load all desired components that are not quarantined.

    Returns False if a hook did not return: the executor is a new one then.
    """
    desired = runner.desired
    desired.left_out = dict(desired.quarantined)
    wanted = [name for name in desired.components if name not in desired.left_out]
    if not wanted:
        return True
    runner.down_reason = restoring = f"its components are being restored: {len(wanted)}"
    try:
        # All at once, for speed; one by one if that fails.
        specs = [desired.components[name] for name in wanted]
        apply = await whole_graph(runner.shared.catalog, specs)
        await runner.ask(wire.Request(apply=apply))
        for name, load in zip(wanted, apply.components, strict=True):
            desired.settle(name, load.component)
    except RequestError:
        if await _leave_out_stuck(runner):
            return False
        if runner.up:
            return await _load_each(runner, wanted)
    finally:
        if runner.down_reason == restoring:  # else the executor has died meanwhile
            runner.down_reason = ""
    return True


async def _leave_out_stuck(runner: RunnerCore) -> bool:
    """If a hook does not return, leave its component out and start a new executor, without graph.

    Returns whether it did.  Only while the loop does not run.
    """
    stuck = await runner.stuck()
    if stuck is None or stuck.component not in runner.desired.components:
        return False
    runner.leave_out(stuck)
    await runner.end_executor(f"{stuck.component}.{stuck.hook}() does not return")
    await runner.take_executor()
    await runner.limit()
    return True


async def start_or_leave_out(runner: RunnerCore, asked: int, agreed: Container[str]) -> None:
    """Start the loop, if need be without optional components whose start() does not return.

    Raises RequestError; the component is left out then.
    """
    while True:
        try:
            require_whole(runner, agreed)
            await start_in_turn(runner, asked)
            return
        except RequestError:
            if not await _leave_out_stuck(runner):
                raise
        await _restore(runner)


async def _start_at_boot(runner: RunnerCore, asked: int, agreed: set[str]) -> None:
    """Start the loop at the start of rtcfd if `on_boot` says so.

    `agreed` are the components without which it ran before.
    """
    if runner.loop.running or not runner.up:
        return
    on_boot = runner.settings().on_boot
    if runner.loop.starts_at_boot(
        resume=on_boot == runner_pb2.ON_BOOT_RESUME, always=on_boot == runner_pb2.ON_BOOT_START
    ):
        word = "resumed" if runner.loop.wanted else "started"
        try:
            await start_or_leave_out(runner, asked, agreed)
            runner.log.info("loop %s", word)
            return
        except RequestError as error:
            missing = missing_parts(runner, agreed)
            why = f"left out of its loop: {listing(missing)}" if missing else str(error)
            runner.loop.held = f"not {word}: {why}"
            runner.log.error("%s", runner.loop.held)
    if runner.loop.wanted:
        runner.loop.want(False)
        await runner.save()


def require_whole(runner: RunnerCore, agreed: Container[str]) -> None:
    """Raise FailedPrecondition if a left-out component is neither optional nor in `agreed`."""
    missing = missing_parts(runner, agreed)
    if not missing:
        return
    first = missing[0]
    words = " ".join(f"--without {name}" for name in missing)
    raise FailedPrecondition(
        f"runner {runner.name}: left out of its loop: {listing(missing)} "
        f"({first}: {runner.desired.left_out[first]}): "
        f"`rtcfctl -r {runner.name} release {first}` loads it again, "
        f"`rtcfctl -r {runner.name} start {words}` goes on without",
        errors_pb2.REASON_COMPONENT_LEFT_OUT,
        component=first,
    )


def missing_parts(runner: RunnerCore, agreed: Container[str]) -> list[str]:
    """Return the left-out components that are neither optional nor in `agreed`."""
    components = runner.desired.components
    return [
        name
        for name in sorted(runner.desired.left_out)
        if name in components and not components[name].optional and name not in agreed
    ]


def advice(runner: RunnerCore) -> str:
    """Return the commands that complete or start a loop after a fault; empty = it needs none."""
    left_out = sorted(runner.desired.left_out)
    if not (left_out or runner.loop.held):
        return ""
    ctl = f"rtcfctl -r {runner.name}"
    lines = [
        f"`{ctl} release {name}` loads {name} again, `{ctl} unload {name}` removes it"
        for name in left_out[:1]
    ]
    if not runner.loop.running:
        words = "".join(f" --without {name}" for name in missing_parts(runner, ()))
        without = ["", " without it", " without them"][min(len(left_out), 2)]
        lines.append(f"`{ctl} start{words}` starts the loop{without}")
    return "; ".join(lines)


async def _settle(runner: RunnerCore) -> None:
    """Wait for a change that the previous rtcfd requested.

    The graph thread, which handles changes in order, rejects an empty unload when its
    turn comes.
    """
    try:
        await runner.ask(wire.Request(unload=control_pb2.UnloadRequest()))
    except InvalidArgument:
        pass
    except RequestError as error:
        runner.log.warning("%s", error)


async def _load_each(runner: RunnerCore, names: Iterable[str]) -> bool:
    """Load components one by one; those that fail are left out and logged.

    Returns False if a hook did not return: the executor is a new one then, without graph.
    """
    for name in names:
        try:
            (load,) = await loads(runner.shared.catalog, [runner.desired.components[name]])
            await runner.ask(wire.Request(load=load))
            runner.desired.left_out.pop(name, None)
            runner.desired.settle(name, load.component)
        except RequestError as error:
            if not runner.up:
                return True  # the executor died, and its recovery loads the rest
            if await _leave_out_stuck(runner):
                return False
            runner.desired.left_out[name] = str(error)
            runner.log.error("%s is left out of the loop: %s", name, error)
    if runner.desired.left_out:
        runner.log.warning("left out of its loop: %s", listing(runner.desired.left_out))
    return True
