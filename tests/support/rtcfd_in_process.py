"""rtcfd's service within the test's process, with peer executors.

The service, the runners, their operations, the state on disk, and the messages to
executors over unix sockets are real; only processes and gRPC are left out, so that
thousands of sequences take minutes.
"""

import asyncio
import contextlib
import contextvars
import json
import logging
import signal
import weakref
from collections.abc import AsyncIterator, Callable, Coroutine
from pathlib import Path
from typing import Any

import grpc
from daemon_process import DEADLINE_S
from peer_executor import Peer
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2
from rtcfd.access import caller
from rtcfd.access.calls import Level
from rtcfd.access.peer import Peer as Who
from rtcfd.catalog.catalog import Catalog, Folder
from rtcfd.catalog.describe import Describer
from rtcfd.common import runner_settings
from rtcfd.common.event_log import EventLog
from rtcfd.common.limits import Limits
from rtcfd.executor import executor, left_over
from rtcfd.executor.command import ExecutorCommand
from rtcfd.executor.link import Link
from rtcfd.executor.watched_process import End
from rtcfd.incidents.incident_files import Incidents
from rtcfd.operations.runner_core import SharedContext
from rtcfd.runners.runner_leases import await_holder
from rtcfd.runners.runners import Runners
from rtcfd.service.control import Control
from rtcfd.state.desired import Desired
from rtcfd.state.saver import Disk
from rtcfd.state.store import Store


class Machine:
    """The running executors by socket, and their delay."""

    def __init__(self) -> None:
        self.peers: dict[str, PeerProcess] = {}
        self.adopted: PeerProcess | None = None  # the executor whose socket was connected last
        self.delay = 0  # steps of the event loop before an executor handles a request

    def install(self, monkeypatch: Any) -> None:
        """Make rtcfd start its executors here."""
        monkeypatch.setattr("rtcfd.executor.executor.subprocess.Popen", self.popen)
        monkeypatch.setattr(executor, "Child", lambda process: process)
        monkeypatch.setattr(executor, "Process", lambda _: self.adopted)
        monkeypatch.setattr("rtcfd.executor.executor._belongs", lambda *_: True)
        connect = Link.connect.__func__  # type: ignore[attr-defined]

        async def remember(cls: Any, peer: str, path: Path, on_unasked: Any) -> Any:
            link = await connect(cls, peer, path, on_unasked)
            self.adopted = self.peers[str(path)]
            return link

        monkeypatch.setattr(Link, "connect", classmethod(remember))

    async def kill_all(self) -> None:
        """Kill all executors at once."""
        processes = list(self.peers.values())
        for each in processes:
            each.signal(signal.SIGKILL)
        for each in processes:
            await each.wait()

    def popen(self, arguments: list[str], **_: Any) -> "PeerProcess":
        return PeerProcess(self, arguments[2], arguments[4])


class SlowPeer(Peer):
    """A delayed peer, which makes changes one at a time as an executor does."""

    def __init__(self, runner: str, machine: Machine) -> None:
        super().__init__(runner)
        self._machine = machine
        self._graph = asyncio.Lock()

    async def answer(self, request: wire.Request) -> None:
        if request.WhichOneof("kind") in ("get_status", "hello", "exit"):
            return await super().answer(request)
        async with self._graph:
            for _ in range(self._machine.delay):
                await asyncio.sleep(0)
            await super().answer(request)


class PeerProcess:
    """A peer executor in place of a process."""

    _last_pid = 100_000

    def __init__(self, machine: Machine, runner: str, socket: str) -> None:
        PeerProcess._last_pid += 1
        self.pid = PeerProcess._last_pid
        self.end: End | None = None
        self.frozen = False
        self.peer = SlowPeer(runner, machine)
        self._machine, self._socket = machine, socket
        self._ended = asyncio.Event()
        # In an own context: it outlives the rtcfd that starts it.
        self._task = asyncio.create_task(self._run(), context=contextvars.Context())

    async def wait(self) -> End:
        await self._ended.wait()
        return End(0)

    def signal(self, _: signal.Signals) -> None:
        self.peer.end.set()

    def release(self) -> None:
        """Stop watching it."""

    async def _run(self) -> None:
        try:
            server = await asyncio.start_unix_server(self.peer.serve, self._socket)
            self._machine.peers[self._socket] = self
            try:
                await self.peer.end.wait()
            finally:
                server.close()
                if self.peer.connections:
                    self.peer.writer.close()
                with contextlib.suppress(OSError):
                    Path(self._socket).unlink()
                del self._machine.peers[self._socket]
        finally:  # also at the end of the event loop, whose tasks wait for this
            self.end = End(0)
            self._ended.set()
            self.peer.recorder.close()


class Lives:
    """The lives of rtcfd, and the tasks of each."""

    def __init__(self) -> None:
        self._life = contextvars.ContextVar("life", default=0)
        self._tasks: dict[int, weakref.WeakSet[asyncio.Task[Any]]] = {}
        asyncio.get_running_loop().set_task_factory(self._make)

    def begin(self) -> None:
        """Begin the next life in the calling task and the tasks that it starts."""
        self._life.set(self._life.get() + 1)

    async def end(self) -> None:
        """Cancel all tasks that this life has started, like the end of a process's event loop."""
        tasks = [task for task in self._tasks.get(self._life.get(), ()) if not task.done()]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _make(
        self, loop: asyncio.AbstractEventLoop, work: Any, context: Any = None
    ) -> "asyncio.Task[Any]":
        make: Any = asyncio.Task  # mypy of Debian 12 does not know its parameter `context`
        task: asyncio.Task[Any] = make(work, loop=loop, context=context)
        life = (context or contextvars.copy_context()).get(self._life, 0)
        self._tasks.setdefault(life, weakref.WeakSet()).add(task)
        return task


class Refused(Exception):
    """A call failed."""


class Context:
    """The gRPC context of one call."""

    async def abort(self, code: grpc.StatusCode, text: str, _: Any) -> None:
        raise Refused(code, text)


class Rtcfd:
    """One life of rtcfd."""

    def __init__(self, folder: Path, packages: Path, machine: Machine) -> None:
        self.machine = machine
        self.folder = folder
        self.state = folder / "state"
        sockets = folder / "executors"
        sockets.mkdir(exist_ok=True, parents=True)
        catalog = Catalog([Folder(packages)], _Descriptions(packages))
        self.store = Store(self.state, sockets)
        self.store.prepare()
        defaults = runner_settings.defaults(runner_pb2.REALTIME_PREFERRED)

        async def no_ros(_: Any, call: wire.ServiceCall) -> wire.ServiceAnswer:
            return wire.ServiceAnswer(call=call.call)

        self.runners = Runners(
            SharedContext(
                command=ExecutorCommand(Path("/nowhere"), sockets),
                catalog=catalog,
                disk=Disk(self.store),
                defaults=defaults,
                on_change=lambda: None,
                serve_ros=no_ros,
                incidents=Incidents(folder / "incidents", Limits),
            )
        )
        self.control = Control(self.runners, catalog, self, EventLog())

    @property
    def refused(self) -> list[str]:
        return []

    def notes(self) -> list[str]:
        return []

    async def reload(self) -> list[str]:
        return []

    async def start(self) -> None:
        """Start as main.py does."""
        states = self.store.load()
        assert not self.store.problems
        if "rt_runner" not in [state.runner for state in states]:
            states.append(Desired("rt_runner"))
        self.runners.adopt(states)
        await self.runners.bring_up(left_over.runners(self.folder / "executors"))
        for runner in self.runners.all():
            await_holder(self.runners, runner)

    async def call(self, method: str, request: Any) -> Any:
        """Make a call; return its last answer. Cancelled like a gRPC call whose client leaves."""
        answers = getattr(self.control, method)(request, Context())
        if not hasattr(answers, "__aiter__"):
            return await answers
        last = None
        async with contextlib.aclosing(answers) as stream:
            async for answer in stream:
                last = answer
        return last

    async def hold(self, method: str, opening: Any, opened: asyncio.Event) -> None:
        """Make a call that lasts; `opened` is set once its lease or stream exists."""

        async def requests() -> AsyncIterator[Any]:
            yield opening
            await asyncio.Event().wait()

        answers = getattr(self.control, method)(requests(), Context())
        async with contextlib.aclosing(answers) as stream:
            async for answer in stream:
                if answer.WhichOneof("kind") in ("taken", "loaded"):
                    opened.set()

    def saved(self, runner: str) -> dict[str, Any] | None:
        """Return the state on disk."""
        try:
            document: dict[str, Any] = json.loads((self.state / f"{runner}.json").read_text())
        except FileNotFoundError:
            return None
        return document

    def peer(self, runner: str) -> Peer | None:
        """Return the running executor of a runner."""
        found = self.machine.peers.get(str(self.folder / "executors" / f"{runner}.sock"))
        return found.peer if found else None


class _Descriptions(Describer):
    """Describes the peers' libraries without a process."""

    def __init__(self, packages: Path) -> None:
        super().__init__(packages)

    async def describe(
        self, library: Path, package: str, owner: int | None = None
    ) -> wire.LibraryDescription:
        types = json.loads(library.read_text())["types"]
        return wire.LibraryDescription(
            types=[graph_pb2.ComponentType(package=package, type=name) for name in types]
        )


async def until(condition: Callable[[], Any], what: str) -> Any:
    """Return the condition's result once it is true; fail after the deadline."""
    loop = asyncio.get_running_loop()
    deadline = loop.time() + DEADLINE_S
    while not (result := condition()):
        assert loop.time() < deadline, f"waited {DEADLINE_S:g} s for {what}"
        await asyncio.sleep(0.001)
    return result


async def called_by(user: str, work: Coroutine[Any, Any, Any]) -> None:
    """Make a call as a user."""

    async def call() -> None:
        caller.enter(caller.Caller(Who(1, 1000, user, frozenset()), Level.ADMIN))
        await work

    await asyncio.create_task(call())


def spec(name: str) -> graph_pb2.ComponentSpec:
    return graph_pb2.ComponentSpec(package="demo", type="Fine", name=name)


def quiet() -> None:
    """Disable logging: thousands of sequences log a lot."""
    logging.disable(logging.CRITICAL)


__all__ = [
    "Lives",
    "Machine",
    "Refused",
    "Rtcfd",
    "called_by",
    "control_pb2",
    "quiet",
    "spec",
    "until",
]
