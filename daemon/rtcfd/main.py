"""The daemon: puts its parts together, runs until a signal, ends in order."""

import asyncio
import contextlib
import logging
import os
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import grpc
from rtcf.v1 import control_pb2_grpc

from rtcfd import VERSION, frames, journal, options
from rtcfd.catalog import Catalog
from rtcfd.command import ExecutorCommand
from rtcfd.describe import Describer
from rtcfd.desired import Desired
from rtcfd.endpoint import Endpoint
from rtcfd.errors import FailedPrecondition, Refusal
from rtcfd.executor import left_overs
from rtcfd.holds import await_holder
from rtcfd.names import DEFAULT_RUNNER
from rtcfd.notify import Notify
from rtcfd.ros_services import RosServices
from rtcfd.runner import Surroundings
from rtcfd.runners import Runners
from rtcfd.service import Control
from rtcfd.store import Store

log = logging.getLogger("rtcfd")

REFUSED = 1
_GRACE_S = 60.0  # for calls under way: the end of their executors ends them sooner
_LAST_WORDS_S = 0.1  # for their answers
_SERVER_OPTIONS = (
    ("grpc.max_receive_message_length", frames.MAX_FRAME),
    ("grpc.max_send_message_length", frames.MAX_FRAME),
)


class Daemon:
    """rtcfd from start to end."""

    def __init__(self, given: options.Options) -> None:
        self._options = given
        self._notify = Notify()
        self._command = ExecutorCommand(given.executor, given.runtime_dir / "executors")
        self._store = Store(given.state_dir)
        catalog = Catalog(given.folders, Describer(given.executor))
        self._runners = Runners(
            Surroundings(
                command=self._command,
                catalog=catalog,
                store=self._store,
                defaults=given.defaults,
                on_change=self._tell,
                serve_ros=RosServices(given.ros_services).serve,
            )
        )
        self._server = grpc.aio.server(options=_SERVER_OPTIONS)
        self._endpoint = Endpoint(given.socket)
        self._left_over: list[str] = []  # runners of executors that outlived another rtcfd
        control_pb2_grpc.add_ControlServicer_to_server(  # type: ignore[no-untyped-call]
            Control(self._runners, catalog), self._server
        )

    async def run(self) -> None:
        """Serve until SIGTERM, SIGINT or SIGHUP."""
        end = asyncio.Event()
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            asyncio.get_running_loop().add_signal_handler(number, end.set)
        if self._options.end_with_stdin:
            _when_stdin_ends(end.set)
        self._command.prepare()
        try:
            self._store.prepare()
        except OSError as error:
            raise FailedPrecondition(
                f"cannot make the state folder {self._options.state_dir}: {error.strerror}"
            ) from None
        self._endpoint.listen(self._server)
        self._left_over = left_overs(self._command.folder)
        states = self._store.load()
        if self._options.default_runner and DEFAULT_RUNNER not in [s.runner for s in states]:
            states.append(Desired(DEFAULT_RUNNER))
        self._runners.adopt(states)
        await self._server.start()
        log.info("rtcfd %s serves %s", VERSION, self._options.socket)
        starting = asyncio.create_task(self._start())
        await end.wait()
        log.info("stopping all loops")
        self._notify.stopping()
        serving = asyncio.create_task(self._server.stop(_GRACE_S))
        await self._runners.close()
        await asyncio.wait({serving}, timeout=_LAST_WORDS_S)
        await self._server.stop(None)
        starting.cancel()
        await asyncio.gather(starting, return_exceptions=True)
        self._clean_up()
        log.info("ended")

    async def _start(self) -> None:
        await self._runners.bring_up(self._left_over)
        for runner in self._runners.all():
            await_holder(self._runners, runner)
        self._notify.ready(self._runners.summary())
        log.info("ready; runners: %s", self._runners.summary())

    def _tell(self) -> None:
        self._notify.status(self._runners.summary())

    def _clean_up(self) -> None:
        self._notify.close()
        self._endpoint.remove()
        # What is not empty or not there stays as it is.
        with contextlib.suppress(OSError):
            self._command.folder.rmdir()
        if self._options.own_runtime_dir:
            with contextlib.suppress(OSError):
                self._options.runtime_dir.rmdir()


def _when_stdin_ends(do: Callable[[], None]) -> None:
    loop = asyncio.get_running_loop()

    def readable() -> None:
        if not os.read(0, 4096):
            loop.remove_reader(0)
            do()

    loop.add_reader(0, readable)


async def _run(given: options.Options) -> None:
    if sys.version_info < (3, 12):
        # The default one starts a thread for each child.
        watcher = asyncio.PidfdChildWatcher()
        watcher.attach_loop(asyncio.get_running_loop())
        asyncio.set_child_watcher(watcher)
    await Daemon(given).run()


def main(arguments: Sequence[str] | None = None, build_tree: Path | None = None) -> int:
    """Run rtcfd; return its exit status: 0 after an orderly end, 1 if it cannot start."""
    try:
        given = options.parse(arguments, build_tree)
        journal.set_up(given.verbose)
        asyncio.run(_run(given))
    except Refusal as refusal:
        print(f"rtcfd: {refusal}", file=sys.stderr)
        return REFUSED
    return 0
