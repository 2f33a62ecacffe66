"""The daemon: assembles its parts, runs until a signal, ends in order."""

import asyncio
import contextlib
import logging
import os
import shutil
import signal
import socket
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

import grpc
from rtcf.v1 import control_pb2, control_pb2_grpc, errors_pb2

from rtcfd import VERSION, check_config, journal
from rtcfd.access.admission import Admission
from rtcfd.access.clients import Clients, GrpcSockets
from rtcfd.access.endpoint import Endpoint
from rtcfd.access.frame_pace import MOST_CALLS
from rtcfd.catalog.catalog import Catalog
from rtcfd.catalog.describe import Describer
from rtcfd.common.background import WorkerThreads
from rtcfd.common.errors import FailedPrecondition, RequestError, Unavailable
from rtcfd.common.names import DEFAULT_RUNNER
from rtcfd.configuration import options
from rtcfd.executor import left_over
from rtcfd.executor.command import ExecutorCommand, claims_folder_of_user
from rtcfd.executor.link import MAX_MESSAGE
from rtcfd.executor.runtime_lock import RuntimeLock
from rtcfd.incidents.incident_files import Incidents
from rtcfd.notify import Notify, machine_goes_down
from rtcfd.operations.runner_core import SharedContext
from rtcfd.reload import Reloads
from rtcfd.runners import ros_services
from rtcfd.runners.runner_leases import await_holder
from rtcfd.runners.runners import Runners
from rtcfd.service.control import Control
from rtcfd.state import handover
from rtcfd.state.desired import Desired
from rtcfd.state.saver import Disk
from rtcfd.state.store import Store

log = logging.getLogger("rtcfd")

REFUSED = 1
_GRACE_S = 60.0  # for running calls; normally the end of their executors ends them earlier
_LAST_WORDS_S = 0.1  # for the responses to them
_OTHERS_MESSAGE_KB = 1024  # largest message of clients that may not stop loops
_LAST_ANSWERS_S = 1.0  # for clients to read the last responses
_EXIT_S = 2.0  # for the process of an rtcfd to exit after its last message
_LOOK_S = 0.05
_LAST_LOOK_S = 5.0  # for a check of the settings, which only gives a warning


class Daemon:
    """rtcfd from start to end."""

    def __init__(self, given: options.Options, read_options: Callable[[], options.Options]) -> None:
        self._options = given
        self._read_options = read_options
        self._notify = Notify()
        self._store = Store(given.state_dir, given.runtime_dir / "executors")
        self._command = ExecutorCommand(
            given.executor,
            given.runtime_dir / "executors",
            given.runtime_dir / "stop",
            # All clients of the control socket may connect; the executor checks their rights.
            0o700 if given.foreground else 0o750,
            self._store.mark,
            private=given.foreground,
            # System loops: a folder to which only their user can write.
            claims_folder=claims_folder_of_user(given.runtime_dir / "cpus")
            if given.foreground
            else given.runtime_dir / "cpus",
        )
        self._endpoint = Endpoint(given.socket, private=given.foreground)
        folder = self._command.folder
        self._sockets = GrpcSockets(folder / "control", folder / "control-others")
        self._runtime_lock = RuntimeLock(self._command, self._sockets.trusted)
        self._admission = admission = Admission(given.access)
        self._clients = Clients(self._sockets, given.limits, admission.level)
        admission.clients = self._clients
        catalog = Catalog(given.folders, Describer(given.executor))
        self._shared = shared = SharedContext(
            command=self._command,
            catalog=catalog,
            disk=Disk(self._store),
            defaults=given.defaults,
            on_change=self._tell,
            serve_ros=ros_services.serve,
            limits=given.limits,
            incidents=Incidents(given.incidents_dir, lambda: self._shared.limits),
            name_of=self._clients.name_of,
        )
        self._runners = Runners(shared)
        self._reloads = Reloads(
            given,
            read_options,
            shared,
            catalog,
            self._runners,
            self._clients,
            admission,
            self._store,
        )
        # One server per private socket, because gRPC's own limits cannot differ between clients.
        self._servers = {
            self._sockets.trusted: grpc.aio.server(
                options=_server_options(given.limits.message_kb), interceptors=[admission]
            ),
            self._sockets.others: grpc.aio.server(
                options=[
                    *_server_options(min(given.limits.message_kb, _OTHERS_MESSAGE_KB)),
                    ("grpc.max_concurrent_streams", MOST_CALLS),
                ],
                interceptors=[admission],
            ),
        }
        self._left_over: list[str] = []  # runners with an executor of an earlier rtcfd
        self._leaving = False  # the loops go on after our end
        control = Control(self._runners, catalog, self._reloads, shared.events)
        for server in self._servers.values():
            control_pb2_grpc.add_ControlServicer_to_server(control, server)  # type: ignore[no-untyped-call]

    async def run(self) -> None:
        """Serve until SIGTERM or SIGINT stops all loops, or SIGUSR1 leaves them to the next rtcfd.

        SIGHUP ends a rtcfd in the foreground, and makes the service reload.
        """
        end = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, end.set)
        loop.add_signal_handler(
            signal.SIGHUP, end.set if self._options.foreground else self._reload
        )
        if not self._options.foreground:
            loop.add_signal_handler(signal.SIGUSR1, self._leave, end)
        if self._options.end_with_stdin:
            _when_stdin_ends(end.set)
        # First of all: if a daemon answers at the socket, the folders belong to it.
        listener = self._endpoint.listen()
        try:
            await self._serve(listener, end)
        finally:
            await self._end_servers(None)
            self._clean_up()
        log.info("ended")

    async def _serve(self, listener: socket.socket, end: asyncio.Event) -> None:
        """Run with the control socket, see run()."""
        await self._runtime_lock.take(end)
        self._command.prepare()
        try:
            self._store.prepare()
        except OSError as error:
            raise FailedPrecondition(
                f"cannot make the state folder {self._options.state_dir}: {error.strerror}",
                errors_pb2.REASON_DAEMON_FAILED,
            ) from None
        await self._lock_state(end)
        self._options.settings.keep()
        self._serve_privately()
        self._shared.rules = await self._reloads.rules()
        self._left_over = left_over.runners(self._command.folder)
        states = self._store.load(self._left_over)
        if self._options.default_runner and DEFAULT_RUNNER not in [s.runner for s in states]:
            states.append(Desired(DEFAULT_RUNNER))
        self._runners.adopt(self._reloads.boot(states, self._left_over))
        for server in self._servers.values():
            await server.start()
        await self._clients.serve(listener)
        log.info("rtcfd %s serves %s", VERSION, self._endpoint.path)
        self._shared.events.add(control_pb2.Event.KIND_DAEMON, f"rtcfd {VERSION} serves")
        self._notify.starting()
        starting = asyncio.create_task(self._start())
        ending = asyncio.create_task(end.wait())
        await asyncio.wait({starting, ending}, return_when=asyncio.FIRST_COMPLETED)
        if starting.done() and (problem := starting.exception()):
            # Serve the runners that work; the status shows the others.
            log.error("the start failed in part", exc_info=problem)
            self._ready()
        await ending
        await (self._let_go() if self._leaving else self._stop())
        starting.cancel()
        await asyncio.gather(starting, return_exceptions=True)
        if not self._leaving:
            handover.remove(self._command.folder)

    async def _lock_state(self, end: asyncio.Event) -> None:
        """Lock the state folder, see Store.lock().

        Waits for the process of an rtcfd that has ended its work and is about to exit.
        """
        loop = asyncio.get_running_loop()
        deadline = loop.time() + _EXIT_S
        while True:
            try:
                return self._store.lock()
            except FailedPrecondition:
                if end.is_set() or loop.time() > deadline:
                    raise
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(end.wait(), _LOOK_S)

    def _leave(self, end: asyncio.Event) -> None:
        self._leaving = True
        end.set()

    async def _stop(self) -> None:
        """End loops and executors, then the servers."""
        log.info("stopping all loops")
        self._notify.stopping("stopping all loops")
        serving = asyncio.create_task(self._end_servers(_GRACE_S))
        await self._runners.close(in_order=not await machine_goes_down())
        await asyncio.wait({serving}, timeout=_LAST_WORDS_S)
        await self._end_servers(None)
        await self._clients.read(_LAST_ANSWERS_S)
        self._clients.close()

    async def _let_go(self) -> None:
        """End for a restart: loops go on, clients wait for the next rtcfd."""
        log.info("leaving all loops to the next rtcfd")
        self._notify.stopping("leaving all loops to the next rtcfd")
        try:
            await WorkerThreads("settings file").run(self._read_options, _LAST_LOOK_S)
        except Unavailable as silence:
            log.error("cannot check the settings for the next rtcfd: %s", silence)
        except RequestError as error:
            log.error("the next rtcfd will use the last good settings: %s", error)
        self._clients.stop_accepting()
        serving = asyncio.create_task(self._end_servers(_GRACE_S))
        await self._runners.leave()
        done, _ = await asyncio.wait({serving}, timeout=_LAST_ANSWERS_S)
        if done:
            await self._clients.read(_LAST_ANSWERS_S)
        # Holders of leases lose their connection, and reconnect.
        self._clients.close()
        await self._end_servers(None)

    async def _start(self) -> None:
        await self._runners.bring_up(self._left_over)
        for runner in self._runners.all():
            await_holder(self._runners, runner)
        await self._reloads.catch_up()
        self._ready()

    def _ready(self) -> None:
        self._notify.ready(self._runners.summary())
        log.info("ready; runners: %s", self._runners.summary())

    def _serve_privately(self) -> None:
        """Bind the gRPC servers to sockets in our folder of mode 0700: only we can connect."""
        for socket_path, server in self._servers.items():
            try:
                bound = server.add_insecure_port(f"unix:{socket_path}")
            except RuntimeError:
                bound = 0
            if not bound:
                raise FailedPrecondition(
                    f"cannot listen on {socket_path}: check that rtcfd may write to its folder",
                    errors_pb2.REASON_DAEMON_FAILED,
                )

    async def _end_servers(self, grace_s: float | None) -> None:
        await asyncio.gather(*(server.stop(grace_s) for server in self._servers.values()))

    def _reload(self) -> None:
        self._runners.operations.in_background("the reload", self._reloads.reload())

    def _tell(self) -> None:
        self._notify.status(self._runners.summary())

    def _clean_up(self) -> None:
        self._notify.close()
        self._endpoint.remove()
        if self._runtime_lock.held:
            # Folders that are not empty stay.
            self._command.remove_folders()
            if self._options.state_dir is None:
                shutil.rmtree(self._options.incidents_dir, ignore_errors=True)
        if self._options.own_runtime_dir:
            with contextlib.suppress(OSError):
                self._options.runtime_dir.rmdir()
        if self._options.end_with_stdin:
            # The process that created it for us may have died.
            with contextlib.suppress(OSError):
                self._options.socket.parent.rmdir()


def _when_stdin_ends(do: Callable[[], None]) -> None:
    loop = asyncio.get_running_loop()

    def readable() -> None:
        if not os.read(0, 4096):
            loop.remove_reader(0)
            do()

    loop.add_reader(0, readable)


def _server_options(message_kb: int) -> list[tuple[str, int]]:
    return [
        ("grpc.max_receive_message_length", message_kb * 1024),
        ("grpc.max_send_message_length", MAX_MESSAGE),
    ]


async def _run(given: options.Options, read_options: Callable[[], options.Options]) -> None:
    if sys.version_info < (3, 12):
        # The default watcher starts a thread per child.
        watcher = asyncio.PidfdChildWatcher()
        watcher.attach_loop(asyncio.get_running_loop())
        asyncio.set_child_watcher(watcher)
    await Daemon(given, read_options).run()


def _reload(wanted: options.Reload) -> int:
    """Make the running rtcfd reload its settings, and print the result."""
    try:
        with grpc.insecure_channel(f"unix:{wanted.socket}") as channel:
            daemon = control_pb2_grpc.ControlStub(channel)  # type: ignore[no-untyped-call]
            response = control_pb2.ReloadResult()
            for message in daemon.Reload(control_pb2.ReloadRequest()):
                response = message.result
            for line in response.notes:
                if line not in response.refused:
                    print(line)
            for line in response.refused:
                print(f"rtcfd: not applied: {line}", file=sys.stderr)
    except grpc.RpcError as error:
        print(f"rtcfd: not reloaded: {error.details()}", file=sys.stderr)
        if wanted.problem and error.code() == grpc.StatusCode.UNAVAILABLE:
            print(f"rtcfd: {wanted.problem}", file=sys.stderr)
        return REFUSED
    if wanted.problem:
        # It has read another file, or the file as another user.
        print(
            f"rtcfd: the rtcfd at {wanted.socket} has reloaded its own settings, but "
            f"{wanted.problem}",
            file=sys.stderr,
        )
    return REFUSED if response.refused or wanted.problem else 0


def _check(arguments: Sequence[str] | None, build_tree: Path | None) -> int:
    """Check settings and graphs, and print the errors."""
    problems = check_config.check(arguments, build_tree)
    for problem in problems:
        print(f"rtcfd: {problem}", file=sys.stderr)
    if not problems:
        print("settings and graphs are valid")
    return REFUSED if problems else 0


def end(status: int) -> NoReturn:
    """End the process, after main() has returned.

    Not by the interpreter's shutdown: a gRPC server that was created but never served waits there
    for ever for its thread, which no longer runs.
    """
    logging.shutdown()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


def main(arguments: Sequence[str] | None = None, build_tree: Path | None = None) -> int:
    """Run rtcfd; return its exit status: 0 after an orderly end, 1 if it cannot start."""
    try:
        if wanted := options.reload_wanted(arguments):
            return _reload(wanted)
        if options.check_wanted(arguments):
            return _check(arguments, build_tree)
        given = options.parse(arguments, build_tree, last_good=True, writable=True)
        journal.set_up(given.verbose)
        if given.settings.problem:
            log.error("%s", given.settings.problem)
        asyncio.run(_run(given, lambda: options.parse(arguments, build_tree, writable=True)))
    except RequestError as error:
        print(f"rtcfd: {error}", file=sys.stderr)
        return REFUSED
    except Exception:
        traceback.print_exc()  # the caller then ends the process by end(), as always
        return REFUSED
    return 0
