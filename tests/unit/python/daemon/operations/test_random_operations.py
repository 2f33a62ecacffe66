"""Random sequences of operations on rtcfd, compared with its guarantees.

After an answered stop no cycle runs until a start is requested, for any state of the disk and
the clock; no lease of a dead client remains; and the disk matches the answers. Each run draws
a few dozen sequences; `--long` draws 10 000, or RTCF_SEQUENCES. Sequences depend only on the
seed (RTCF_SEED, 1 by default), besides stored sequences that failed before.
"""

import asyncio
import contextlib
import json
import os
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest
from daemon_process import DEADLINE_S
from failing_disk import MODES, FailingDisk
from hypothesis import HealthCheck, Phase, example, given, seed, settings
from hypothesis import strategies as st
from rtcf.v1 import control_pb2, runner_pb2
from rtcfd.runners import component_leases, runner_leases
from rtcfd_in_process import Lives, Machine, Refused, Rtcfd, quiet, spec

SEED = int(os.environ.get("RTCF_SEED", "1"))
RUNNERS = ("rt_runner", "arm")
NAMES = ("a", "b")

runners = st.sampled_from(RUNNERS)
actions = st.one_of(
    st.tuples(st.sampled_from(["Start", "Stop", "RestartRunner", "AddRunner"]), runners),
    st.tuples(st.just("RemoveRunner"), st.just("arm")),
    st.tuples(
        st.sampled_from(["Load", "Unload", "LeaseComponent"]), runners, st.sampled_from(NAMES)
    ),
    st.tuples(st.sampled_from(["Apply", "HoldRunner"]), runners),
    # SIGKILL kills rtcfd and all executors at once.
    st.tuples(st.sampled_from(["SIGTERM", "SIGUSR1", "SIGKILL"])),
    st.tuples(st.just("disk"), st.sampled_from(MODES)),
    st.tuples(st.just("clock"), st.sampled_from([-3600.0, 3600.0, 1e9])),
)
# The caller waits for the answer, continues meanwhile, or disconnects after some steps.
callers = st.one_of(st.just("waits"), st.just("goes on"), st.integers(0, 30))
steps = st.tuples(actions, callers, st.integers(0, 5))


class Sequence:
    """One sequence: rtcfd, its clients, and the guarantees."""

    def __init__(self, folder: Path, packages: Path, machine: Machine, world: "World") -> None:
        self._folder, self._packages, self._machine = folder, packages, machine
        self._world = world
        self._callers: set[asyncio.Task[None]] = set()
        # Runners whose last answered call was a stop.
        self._stopped: set[str] = set(RUNNERS)
        self._starts = dict.fromkeys(RUNNERS, 0)
        self._lives = Lives()
        self.rtcfd = Rtcfd(folder, packages, machine)

    async def play(self, sequence: list[Any]) -> None:
        watching = asyncio.create_task(self._watch())
        self._lives.begin()
        await self.rtcfd.start()
        for action, caller, delay in sequence:
            self._machine.delay = delay
            await self._take(action, caller)
            if watching.done():
                break
        self._world.disk.become("well")
        await self._let_all_go()
        await self._quiet()
        for runner in self.rtcfd.runners.all():
            assert await runner.saver.begin() == ""
        watching.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await watching
        self._check_end()
        await self.rtcfd.runners.close(in_order=True)
        for state in self.rtcfd.store.load():
            assert not state.running, f"the next rtcfd starts {state.runner}"

    async def _take(self, action: Any, caller: Any) -> None:
        if action[0] in ("SIGTERM", "SIGUSR1", "SIGKILL"):
            await self._restart(action[0])
            return
        if action[0] == "disk":
            self._world.disk.become(action[1])
            return
        if action[0] == "clock":
            self._world.clock_s += action[1]
            return
        task = asyncio.create_task(self._call(*action))
        self._callers.add(task)
        task.add_done_callback(self._callers.discard)
        if caller == "waits" and action[0] not in ("HoldRunner", "LeaseComponent"):
            await task
        elif isinstance(caller, int):
            for _ in range(caller):
                await asyncio.sleep(0)
            await self._leave({task})

    async def _call(self, method: str, runner: str, name: str = "") -> None:
        rtcfd = self.rtcfd
        with contextlib.suppress(Refused):
            if method == "Start":
                self._starts[runner] += 1
                self._stopped.discard(runner)
                await rtcfd.call("Start", control_pb2.StartRequest(runner=runner))
            elif method == "Stop":
                starts = self._starts[runner]
                answer = await rtcfd.call("Stop", control_pb2.StopRequest(runner=runner))
                if starts == self._starts[runner]:
                    self._stopped.add(runner)
                    saved = rtcfd.saved(runner)
                    told = any(note.startswith("not saved") for note in answer.result.notes)
                    assert told or saved is None or not saved["running"], "a stop is on disk"
            elif method == "Load":
                request: Any = control_pb2.LoadRequest(runner=runner, component=spec(name))
                await rtcfd.call("Load", request)
            elif method == "Unload":
                request = control_pb2.UnloadRequest(runner=runner, components=[name])
                await rtcfd.call("Unload", request)
            elif method == "Apply":
                request = control_pb2.ApplyRequest(runner=runner, components=[spec("a")])
                await rtcfd.call("Apply", request)
            elif method == "HoldRunner":
                opening = control_pb2.OpenHold(runner=runner, token="t", holder="somebody")
                request = control_pb2.HoldRunnerRequest(open=opening)
                await rtcfd.hold("HoldRunner", request, asyncio.Event())
            elif method == "LeaseComponent":
                lease = control_pb2.OpenLease(runner=runner, component=spec(name), holder="h")
                request = control_pb2.LeaseComponentRequest(open=lease)
                await rtcfd.hold("LeaseComponent", request, asyncio.Event())
            elif method == "AddRunner":
                chosen = runner_pb2.RunnerSettings(on_boot=runner_pb2.ON_BOOT_RESUME)
                request = control_pb2.AddRunnerRequest(runner=runner, settings=chosen)
                await rtcfd.call("AddRunner", request)
            else:
                kind = getattr(control_pb2, f"{method}Request")
                await rtcfd.call(method, kind(runner=runner))

    async def _restart(self, number: str) -> None:
        """End rtcfd and start its successor; connections end with it."""
        if number == "SIGTERM":
            await self.rtcfd.runners.close(in_order=True)
            self._stopped |= set(RUNNERS)
        elif number == "SIGKILL":
            self._world.disk.become("dead")  # pending writes are lost
            await self.rtcfd.runners.leave()
            await self._machine.kill_all()
        else:
            await self.rtcfd.runners.leave()
        await self._let_all_go()
        await self._lives.end()
        self._world.disk.next_life()
        self._lives.begin()
        self.rtcfd = Rtcfd(self._folder, self._packages, self._machine)
        await self.rtcfd.start()

    async def _watch(self) -> None:
        """Check that no cycle runs after an answered stop."""
        while True:
            for runner in self._stopped:
                peer = self.rtcfd.peer(runner)
                assert peer is None or not peer.running, f"{runner} runs after an answered stop"
            await asyncio.sleep(0)

    async def _let_all_go(self) -> None:
        await self._leave(set(self._callers))

    async def _leave(self, tasks: set[asyncio.Task[None]]) -> None:
        for task in tasks:
            task.cancel()
        for result in await asyncio.gather(*tasks, return_exceptions=True):
            if isinstance(result, Exception):
                raise result

    async def _quiet(self) -> None:
        """Wait until rtcfd is idle."""
        async with asyncio.timeout(DEADLINE_S):
            for _ in range(3):
                await self.rtcfd.runners.operations.drain()
                for runner in self.rtcfd.runners.all():
                    await runner.operations.drain()

    def _check_end(self) -> None:
        for name in RUNNERS:
            saved, peer = self.rtcfd.saved(name), self.rtcfd.peer(name)
            known = name in [runner.name for runner in self.rtcfd.runners.all()]
            assert (peer is not None) == known
            # A runner that a bad disk did not remove returns with the next rtcfd, held.
            if name == "arm" and not self._world.disk.ever_bad:
                assert (saved is not None) == known, "runners match the state"
            if saved is None or peer is None:
                continue
            assert saved["hold"] is None and saved["leased"] == {}, "no lease of the dead"
            assert saved["running"] == peer.running
            assert sorted(f"/{each['name']}" for each in saved["components"]) == sorted(
                peer.components
            )


@pytest.fixture(scope="module")
def place() -> Any:
    # In memory: each save is synced to the disk.
    memory = Path("/dev/shm")
    folder = Path(tempfile.mkdtemp(dir=memory if memory.is_dir() else None))
    library = folder / "lib" / "demo" / "main.so"
    library.parent.mkdir(parents=True)
    library.write_text(json.dumps({"types": {"Fine": "fine"}}))
    yield folder
    shutil.rmtree(folder)


class World:
    """The environment of rtcfd: a disk that may fail, and a clock that may jump."""

    def __init__(self) -> None:
        self.disk = FailingDisk()
        self.clock_s = 0.0

    def install(self, monkeypatch: Any) -> None:
        self.disk.install(monkeypatch)
        now_s, now_ns = time.time, time.time_ns
        monkeypatch.setattr(time, "time", lambda: now_s() + self.clock_s)
        monkeypatch.setattr(time, "time_ns", lambda: now_ns() + int(self.clock_s) * 10**9)


@pytest.fixture(scope="module")
def world() -> Any:
    world = World()
    with pytest.MonkeyPatch.context() as patch:
        world.install(patch)
        yield world
        world.disk.next_life()


@pytest.fixture(scope="module")
def machine() -> Any:
    machine = Machine()
    with pytest.MonkeyPatch.context() as patch:
        machine.install(patch)
        patch.setattr(component_leases, "RETURN_S", 0.01)
        patch.setattr(runner_leases, "RETURN_S", 0.01)
        patch.setattr(component_leases, "GATHER_S", 0.001)
        patch.setattr("rtcf_shared.whole_files.os.fsync", lambda _: None)
        quiet()
        yield machine
        import logging

        logging.disable(logging.NOTSET)


def play(sequence: list[Any], place: Path, machine: Machine, world: World) -> None:
    folder = Path(tempfile.mkdtemp(dir=place))
    world.disk.begin(folder / "state")
    world.clock_s = 0.0

    async def run() -> None:
        machine.peers.clear()
        await Sequence(folder, place / "lib", machine, world).play(sequence)

    asyncio.run(run())
    shutil.rmtree(folder)


def drawn(number: int) -> Any:
    """Give a test this many sequences, drawn from the seed."""

    def decorate(test: Any) -> Any:
        health = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
        test = given(st.lists(steps, min_size=1, max_size=12))(test)
        test = settings(
            max_examples=number,
            suppress_health_check=health,
            phases=[Phase.explicit, Phase.reuse, Phase.generate, Phase.shrink],
        )(test)
        return seed(SEED)(test)

    return decorate


# A start during the release of a launch's runner.
@example(sequence=[(("HoldRunner", "rt_runner"), 3, 0), (("Start", "rt_runner"), "waits", 0)])
# A stop that a hanging disk does not store, and the end of everything.
@example(
    sequence=[
        (("AddRunner", "arm"), "waits", 0),
        (("Start", "arm"), "waits", 0),
        (("disk", "hangs"), "waits", 0),
        (("Stop", "arm"), "waits", 0),
        (("SIGKILL",), "waits", 0),
    ]
)
# A removal that a bad disk refuses.
@example(
    sequence=[
        (("AddRunner", "arm"), "waits", 0),
        (("Start", "arm"), "waits", 0),
        (("disk", "read-only"), "waits", 0),
        (("RemoveRunner", "arm"), "waits", 0),
    ]
)
@drawn(40)  # type: ignore[misc]
def test_random_sequences_keep_the_guarantees(
    place: Path, machine: Machine, world: World, sequence: list[Any]
) -> None:
    play(sequence, place, machine, world)


@pytest.mark.long
@drawn(  # type: ignore[misc]
    int(os.environ.get("RTCF_SEQUENCES", "10000"))
)
def test_ten_thousand_random_sequences_keep_the_guarantees(
    place: Path, machine: Machine, world: World, sequence: list[Any]
) -> None:
    play(sequence, place, machine, world)
