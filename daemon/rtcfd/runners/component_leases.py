"""Leases on components: a leased component stays loaded while its client is connected.

Owned by the Runner, on rtcfd's one thread.  The terms of each lease belong to the
desired state, so that a restarted rtcfd knows the holders to wait for.  The components
themselves are not saved.
"""

import asyncio
from collections.abc import Callable, Coroutine, Iterable
from typing import Any

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2

from rtcfd.common.errors import (
    AlreadyExists,
    FailedPrecondition,
    NotFound,
    RequestError,
    Unavailable,
)
from rtcfd.common.names import full_name
from rtcfd.operations import graph, parameters
from rtcfd.operations.loop import stop_quietly
from rtcfd.operations.runner_core import RunnerCore
from rtcfd.runners.outbox import Outbox
from rtcfd.state.desired import ComponentLeaseTerms

# Time for holders to reconnect after a restart of rtcfd.
RETURN_S = 10.0
# Leases of one launch that end within this time of each other end in one transaction.
GATHER_S = 0.2
_LONGEST_GATHER_S = 1.0

_Ended = control_pb2.LeaseEnded


class ComponentLease:
    """The lease of one call on a component.  `open` first, then `end` or `lost`."""

    def __init__(
        self, leases: "ComponentLeases", request: control_pb2.OpenLease, outbox: Outbox
    ) -> None:
        self._leases = leases
        self._request = request
        self._outbox = outbox

    async def open(self) -> None:
        """Load the component, or attach to it again; send the result to the holder."""
        if self._request.attach:
            result = self._leases.attach(self._request, self._outbox)
        elif self._request.wait:
            result = await graph.when_master(
                lambda: self._leases.open(self._request, self._outbox), self._outbox.waiting
            )
        else:
            result = await self._leases.open(self._request, self._outbox)
        self._outbox.say(loaded=result)

    async def end(self) -> None:
        """Unload the component, on request of its holder."""
        await self._leases.end(full_name(self._request.component), self._outbox)

    def lost(self) -> None:
        """Apply `on_lost` of the lease after the death of the holder."""
        self._outbox.gone = True
        self._leases.lost(full_name(self._request.component), self._outbox)


class ComponentLeases:
    """All leases of a runner's components."""

    def __init__(self, runner: RunnerCore, alarm: Callable[[str], None]) -> None:
        self._runner = runner
        self._alarm = alarm
        self._outboxes: dict[str, Outbox] = {}  # by component, of connected holders
        self._sent_notes: set[str] = set()  # notes that holders of this launch have received
        self._loading: set[str] = set()
        self._losing: set[str] = set()  # their holders have died, and `on_lost` is being applied
        self._leaving: dict[str, asyncio.Task[None]] = {}
        self._groups: dict[str, list[str]] = {}  # by launch, components to unload together
        self._patience: asyncio.Task[None] | None = None  # waits for holders after a restart

    @property
    def _terms(self) -> dict[str, ComponentLeaseTerms]:
        return self._runner.desired.leased

    async def open(
        self, request: control_pb2.OpenLease, outbox: Outbox
    ) -> control_pb2.ChangeResult:
        """Load a component for a holder."""
        runner, spec = self._runner, request.component
        library = await runner.shared.catalog.find(spec.package, spec.type)
        library.set_vector_sizes(spec)
        note = library.note(spec)
        name = full_name(spec)
        if leaving := self._leaving.get(name):
            outbox.waiting(f"waiting for the earlier {name} to be unloaded")
            await asyncio.wait({leaving})

        async def work() -> control_pb2.ChangeResult:
            if outbox.gone:
                raise Unavailable(
                    f"the client that requested {name} has disconnected",
                    errors_pb2.REASON_CALLER_GONE,
                    component=name,
                )
            self._check_hold(request.hold)
            runner.shared.limits.check_components(len(runner.desired.components) + 1)
            if name in runner.desired.components:
                raise AlreadyExists(
                    f"component {name} exists already in runner {runner.name}: "
                    "give this one another name or namespace",
                    errors_pb2.REASON_COMPONENT_EXISTS,
                    component=name,
                )
            # Saved in advance: if rtcfd dies meanwhile, the next one must know of the lease.
            self._terms[name] = ComponentLeaseTerms(
                request.run_id, request.on_lost or control_pb2.ON_LEASE_LOST_STOP, request.holder
            )
            self._outboxes[name] = outbox
            outbox.unseen = request.unseen
            self._loading.add(name)
            await runner.save()
            try:
                load = wire.Request(load=library.load(spec))
                result = (await runner.ask(load, outbox.progress)).change
                runner.desired.put(name, spec)
                holder = request.holder or "a lease"
                runner.happened(
                    control_pb2.Event.KIND_GRAPH, f"{name} loaded ({code}) for {holder}", name
                )
                parameters.note(runner, name, spec.parameters, {}, None, "launch", holder)
            except BaseException:
                self._outboxes.pop(name, None)
                # An executor left to the next rtcfd may still load it: then the lease must stay.
                if not runner.leaving:
                    self._terms.pop(name, None)
                    await runner.save()
                raise
            finally:
                self._loading.discard(name)
            runner.log.info("%s loaded (%s) for %s", name, code, holder)
            if outbox.gone:  # its holder never used it: unload it without stopping the loop
                self._leave(name)
            return result

        code = f"{spec.package}/{spec.type}"
        result = await runner.change(f"the load of {code}", work)
        if note:
            runner.log.warning(note)
            result.notes.append(note)
        self._remove_sent_notes(result)
        return result

    def _remove_sent_notes(self, result: control_pb2.ChangeResult) -> None:
        """Remove notes that another holder has received: launchers print to one screen."""
        if len(self._terms) <= 1:
            self._sent_notes.clear()
        fresh = [note for note in result.notes if note not in self._sent_notes]
        self._sent_notes.update(fresh)
        result.notes[:] = fresh

    def attach(self, request: control_pb2.OpenLease, outbox: Outbox) -> control_pb2.ChangeResult:
        """Give a component back to its holder, which has reconnected."""
        name = full_name(request.component)
        terms = self._terms.get(name)
        if terms is not None and (name in self._losing or name in self._leaving):
            raise NotFound(
                f"the lease of {name} in runner {self._runner.name} is being ended, as its holder "
                "was gone: open another",
                errors_pb2.REASON_LEASE_NOT_FOUND,
                component=name,
            )
        if terms is None or terms.run_id != request.run_id or name in self._outboxes:
            raise NotFound(
                f"runner {self._runner.name} keeps no {name} for its launcher any more",
                errors_pb2.REASON_LEASE_NOT_FOUND,
                component=name,
            )
        self._outboxes[name] = outbox
        outbox.unseen = request.unseen
        self._runner.log.info("%s: its holder is back", name)
        return control_pb2.ChangeResult(component=name)

    async def end(self, name: str, outbox: Outbox) -> None:
        """Unload a component on request of its holder; return when it is unloaded."""
        if self._outboxes.get(name) is not outbox:
            return
        task = self._leaving.get(name) or self._leave(name)
        await asyncio.wait({task})

    def lost(self, name: str, outbox: Outbox) -> None:
        """Apply `on_lost` of a lease after the connection of its holder has broken."""
        if self._outboxes.get(name) is not outbox or name in self._leaving:
            return
        if name in self._loading:
            return  # open() handles it
        del self._outboxes[name]
        self._runner.operations.in_background(
            f"the end of the lease of {name}", self._lost(name, "has died")
        )

    def await_holders(self) -> None:
        """Give holders time to reconnect, after a restart of rtcfd."""
        waiting = [name for name in self._terms if name not in self._outboxes]
        if waiting:
            self._patience = self._runner.operations.in_background(
                "waiting for holders", self._await(waiting)
            )

    def take_log(self, record: control_pb2.LogRecord) -> bool:
        """Send a record to the holder of its component; return whether the holder shows it."""
        outbox = self._outboxes.get(record.component)
        if outbox is None or outbox.ended:
            return False
        outbox.log(record)
        warns = record.level >= control_pb2.LogRecord.LEVEL_WARN
        return warns or not outbox.unseen

    def failed(self, component: str, reason: str) -> None:
        """Tell a holder that its component has failed, and unload the component."""
        outbox = self._outboxes.get(component)
        if outbox is not None and component not in self._leaving | dict.fromkeys(self._loading):
            outbox.end(_Ended.WHY_FAILED, reason)
            self._leave(component)

    def settle(self) -> None:
        """Notify holders whose component is no longer in the loop; called after each change."""
        runner = self._runner
        for name, outbox in list(self._outboxes.items()):
            if name in self._loading or name in self._leaving:
                continue
            if name not in self._terms:
                outbox.end(_Ended.WHY_UNLOADED, f"{name} was unloaded by another client")
                del self._outboxes[name]
            elif runner.up and name in runner.desired.left_out:
                self.failed(name, runner.desired.left_out[name])

    async def unload_all(self) -> None:
        """Unload all leased components, while their holders still receive log records."""
        runner = self._runner
        names = [
            name
            for name in self._outboxes
            if name in runner.desired.components and name not in self._leaving
        ]
        self._loading.update(names)  # settle() skips them
        try:
            if names:
                request = control_pb2.UnloadRequest(components=names)
                await graph.unload(runner, request, lambda _: None, patient=True)
        except RequestError as error:
            runner.log.error("%s", error)
        finally:
            self._loading.difference_update(names)
        if self._leaving:
            await asyncio.wait(set(self._leaving.values()))

    def end_all(self, why: "control_pb2.LeaseEnded.Why", message: str) -> None:
        """Tell all holders that their leases have ended; the caller unloads the components."""
        self.lose_patience()
        for outbox in self._outboxes.values():
            outbox.end(why, message)
        self._outboxes.clear()

    def lose_patience(self) -> None:
        """Stop waiting for holders, because the runner or rtcfd ends."""
        if self._patience is not None:
            self._patience.cancel()

    def _check_hold(self, token: str) -> None:
        hold = self._runner.desired.hold
        if token and (hold is None or hold.token != token):
            raise FailedPrecondition(
                f"the holder of runner {self._runner.name} has ended", errors_pb2.REASON_HOLDER_GONE
            )

    async def _await(self, names: Iterable[str]) -> None:
        await asyncio.sleep(RETURN_S)
        for name in names:
            if name in self._terms and name not in self._outboxes and name not in self._leaving:
                await self._lost(name, f"did not come back within {RETURN_S:g} s")

    def _lost(self, name: str, how: str) -> Coroutine[Any, Any, None]:
        """Return the coroutine that ends a lease; from now on its holder cannot reconnect."""
        self._losing.add(name)

        async def work() -> None:
            try:
                await self._lose(name, how)
            finally:
                self._losing.discard(name)

        return work()

    async def _lose(self, name: str, how: str) -> None:
        runner, terms = self._runner, self._terms.get(name)
        if terms is None or runner.closing:
            return
        lost = f"{terms.holder or 'its holder'} {how}"
        if terms.on_lost == control_pb2.ON_LEASE_LOST_KEEP:
            runner.log.warning("%s: %s: kept", name, lost)
            await parameters.undo_with(runner, terms, lost)
            self._terms.pop(name, None)
            await runner.save()
            return
        if terms.on_lost != control_pb2.ON_LEASE_LOST_UNLOAD and runner.loop.running:
            self._alarm(f"{name}: {lost}: stopping the loop")
            await stop_quietly(runner)
        else:
            runner.log.warning("%s: %s", name, lost)
        await parameters.undo_with(runner, terms, lost)
        self._leave(name)

    def _leave(self, name: str) -> "asyncio.Task[None]":
        """Unload a component, together with others of its launch that end now."""
        terms = self._terms.get(name)
        run = terms.run_id if terms and terms.run_id else name
        group = self._groups.get(run)
        if group is None:
            group = self._groups[run] = []
            task = self._runner.operations.in_background(
                f"the end of {run}", self._unload(run, group)
            )
        else:
            task = self._leaving[group[0]]
        group.append(name)
        self._leaving[name] = task
        return task

    async def _unload(self, run: str, group: list[str]) -> None:
        loop = asyncio.get_running_loop()
        deadline = loop.time() + _LONGEST_GATHER_S
        count = 0
        while count < len(group) and loop.time() < deadline:
            count = len(group)
            await asyncio.sleep(GATHER_S)
        del self._groups[run]
        runner = self._runner
        try:
            names = [name for name in group if name in runner.desired.components]
            if names and not runner.closing:
                request = control_pb2.UnloadRequest(components=names)
                await graph.unload(runner, request, lambda _: None, patient=True)
        except RequestError as error:
            # It has no holder now; the list of components shows it.
            runner.log.error("%s stays loaded: %s", ", ".join(group), error)
        forgotten = [self._terms.pop(name) for name in group if name in self._terms]
        if forgotten and not runner.closing:
            await runner.save()
        for name in group:
            self._leaving.pop(name, None)
            self._outboxes.pop(name, None)
        runner.notify_change()
