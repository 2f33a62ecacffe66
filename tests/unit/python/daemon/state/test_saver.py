"""Saves to a disk that does not answer."""

import asyncio
import contextlib
import json
import logging
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from daemon_process import DEADLINE_S
from rtcfd.state.desired import Desired
from rtcfd.state.saver import Disk, Saver
from rtcfd.state.store import Store

log = logging.getLogger("test")
NOT_YET = ["not saved yet: the disk of the state folder does not answer"]


class HangingStore(Store):
    """A store whose folder is on a disk that may hang; the folder of stop notes is not on it."""

    def __init__(self, folder: Path) -> None:
        self.state, self.boot = folder / "state", folder / "boot"
        self.boot.mkdir(exist_ok=True)
        super().__init__(self.state, self.boot)
        self.prepare()
        self.saves: list[bool] = []
        self.begun = 0  # number of saves started
        self.takes_one = False  # whether the disk completes one more save before it hangs
        self._answers = threading.Event()
        self._answers.set()

    @contextlib.contextmanager
    def hanging(self) -> Iterator[None]:
        self._answers.clear()
        try:
            yield
        finally:
            self._answers.set()

    def save(self, runner: str, text: bytes, running: bool) -> None:
        self.begun += 1
        assert self._answers.wait(DEADLINE_S)
        super().save(runner, text, running)
        self.saves.append(running)
        if self.takes_one:
            self.takes_one = False
            self._answers.clear()

    def take_one(self) -> None:
        """Complete one of the hanging saves."""
        self.takes_one = True
        self._answers.set()

    def remove(self, runner: str) -> None:
        assert self._answers.wait(DEADLINE_S)
        super().remove(runner)


@pytest.fixture
def store(tmp_path: Path) -> HangingStore:
    return HangingStore(tmp_path)


def loaded(store: HangingStore) -> Desired:
    """Return the state that the next rtcfd loads."""
    (state,) = Store(store.state, store.boot).load()
    return state


def saver_of(desired: Desired, store: Store) -> Saver:
    return Saver(desired, Disk(store), log)


def test_a_save_to_a_hanging_disk_returns_with_a_note(
    store: HangingStore,
) -> None:
    async def run() -> None:
        saver = saver_of(Desired("arm"), store)
        with store.hanging():
            assert await saver.save() == NOT_YET
            assert saver.problem == NOT_YET[0]
        await saver.finish(DEADLINE_S)
        assert saver.problem == ""
        assert await saver.save() == []

    asyncio.run(run())


def test_the_last_state_is_on_disk_once_a_hanging_disk_answers(
    store: HangingStore,
) -> None:
    async def run() -> None:
        desired = Desired("arm")
        saver = saver_of(desired, store)
        with store.hanging():
            for count in range(20):
                desired.running = count % 2 == 0
                saver.begin()
                await asyncio.sleep(0)  # the first save is in progress
            desired.running = True
            saver.begin()
        await saver.finish(DEADLINE_S)

    asyncio.run(run())
    assert loaded(store).running
    assert len(store.saves) == 2, "queued saves are merged"


def test_a_stop_during_a_disk_hang_is_known_to_the_next_rtcfd(
    store: HangingStore,
) -> None:
    async def run() -> None:
        desired = Desired("arm")
        saver = saver_of(desired, store)
        desired.running = True
        assert await saver.save() == []
        with store.hanging():
            desired.running = False
            assert await saver.save() == NOT_YET
            # The disk says that it runs.
            assert json.loads((store.state / "arm.json").read_text())["running"] is True
            assert not loaded(store).running
            desired.running = True
            assert await saver.save() == NOT_YET
        await saver.finish(DEADLINE_S)

    asyncio.run(run())
    assert loaded(store).running, "the start is the last operation"


def test_a_save_older_than_a_stop_keeps_the_stops_note(store: HangingStore) -> None:
    async def run() -> None:
        desired = Desired("arm")
        saver = saver_of(desired, store)
        with store.hanging():
            desired.running = True
            assert await saver.save() == NOT_YET
            desired.running = False
            assert await saver.save() == NOT_YET
            store.take_one()
            async with asyncio.timeout(DEADLINE_S):
                while store.begun < 2:
                    await asyncio.sleep(0.01)
            assert store.saves == [True]
            assert not loaded(store).running
        await saver.finish(DEADLINE_S)

    asyncio.run(run())
    assert not loaded(store).running


def test_a_late_removal_does_not_remove_a_runner_added_again(
    store: HangingStore,
) -> None:
    async def run() -> None:
        disk = Disk(store)
        first = Saver(Desired("arm"), disk, log)
        await first.save()
        with store.hanging():
            await first.forget()
            await first.save()
            second = Saver(Desired("arm"), disk, log)
            assert await second.save() == NOT_YET
        await second.finish(DEADLINE_S)

    asyncio.run(run())
    assert loaded(store).runner == "arm"


def test_a_removed_runner_on_a_hanging_disk_is_not_resumed(store: HangingStore) -> None:
    async def run() -> None:
        desired = Desired("arm")
        desired.running = True
        saver = saver_of(desired, store)
        await saver.save()
        with store.hanging():
            await saver.forget()
            assert not loaded(store).running
        await saver.finish(DEADLINE_S)

    asyncio.run(run())
    assert Store(store.state, store.boot).load() == []


def test_a_failed_save_is_reported_until_one_succeeds(store: HangingStore) -> None:
    async def run() -> Any:
        saver = saver_of(Desired("arm"), store)
        store.state.rmdir()
        assert await saver.save() == ["not saved: No such file or directory"]
        assert saver.problem == "not saved: No such file or directory"
        store.state.mkdir()
        assert await saver.save() == []
        assert saver.problem == ""

    asyncio.run(run())
