"""Several pages of the scope: requests of one do not affect another."""

import asyncio
import contextlib
import functools
import os
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

import hypothesis
import numpy as np
import pytest
import rtcf
from daemon_process import Daemon
from hypothesis import strategies as st
from rtcf.v1 import graph_pb2
from scope_process import ScopeProcess, looping
from scope_visit import CYCLES, SHOT, ScopePage, Visit

SEED = int(os.environ.get("RTCF_SEED", "1"))
GHOSTS = [f"/ghost{number}.out" for number in range(300)]
LEVEL = {"kind": "level", "low": -1e9, "before": 1, "after": 1}  # hits at once


def _wave(name: str) -> graph_pb2.ComponentSpec:
    return rtcf.component("rtcf_examples", "Wave", name=name, parameters=["rate:=1.0"])


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Yield a daemon with a running loop, shared by all tests here."""
    components = [_wave("wave"), rtcf.component("rtcf_examples", "Mimo", name="mimo")]
    with looping(tmp_path_factory.mktemp("loop"), components) as daemon:
        yield daemon


@pytest.fixture
def client(loop: Daemon) -> Iterator[rtcf.Client]:
    with rtcf.Client(loop.socket) as client:
        yield client


class _Healthy:
    """A page that shows an existing signal, and everything that it receives."""

    def __init__(self) -> None:
        self.cycles: list[int] = []
        self.lost = 0.0
        self.texts: list[dict[str, Any]] = []
        self._some = asyncio.Event()

    @contextlib.asynccontextmanager
    async def watching(self, scope: ScopeProcess) -> AsyncIterator["_Healthy"]:
        """Watch the signal during the block."""
        async with Visit(scope) as page:
            await page.say(watch=["/wave.phase"])
            await page.binary(CYCLES, traces=1)
            looking = asyncio.create_task(self._look(page))
            try:
                await self.some()
                yield self
            finally:
                looking.cancel()
                await asyncio.gather(looking, return_exceptions=True)

    async def some(self) -> None:
        """Wait until it has received some more cycles."""
        until = len(self.cycles) + 50
        while len(self.cycles) < until:
            self._some.clear()
            await asyncio.wait_for(self._some.wait(), 60)

    async def _look(self, page: ScopePage) -> None:
        while True:
            head, columns = await page.binary(CYCLES)
            assert len(columns) == 5 and np.isfinite(columns[4]).all()
            self.cycles += columns[1].astype(int).tolist()
            self.lost += head[6]
            self.texts = page.texts
            self._some.set()

    def check(self) -> None:
        """Fail unless it has received all cycles, and no error."""
        gaps = [
            pair
            for pair in zip(self.cycles, self.cycles[1:], strict=False)
            if pair[1] != pair[0] + 1
        ]
        assert not gaps and not self.lost
        bad = ("missing", "refused", "error")
        wrong = [each for each in self.texts if each["kind"] in bad and each["text"]]
        assert not wrong


def test_a_missing_signal_is_named_and_appears_with_its_component(
    scope: ScopeProcess, client: rtcf.Client
) -> None:
    async def look() -> None:
        async with _Healthy().watching(scope) as healthy, Visit(scope) as page:
            await page.say(watch=["/mimo.out1", "/late.wave", "/mimo.none", "/mimo.out1[9]"])
            missing = await page.text("missing")
            assert missing["names"] == ["/late.wave", "/mimo.none", "/mimo.out1[9]"]
            assert missing["text"] == (
                "signals omitted until they exist: /late.wave, /mimo.none, /mimo.out1[9]"
            )
            await page.binary(CYCLES, traces=1)
            await asyncio.to_thread(client.load, _wave("late"))
            try:
                assert (await page.text("missing"))["names"] == ["/mimo.none", "/mimo.out1[9]"]
                await page.binary(CYCLES, traces=2)
            finally:
                await asyncio.to_thread(client.unload, ["late"])
            assert "/late.wave" in (await page.text("missing"))["names"]
            await page.binary(CYCLES, traces=1)
            await page.say(watch=["/mimo.out1"])
            assert (await page.text("missing"))["text"] == ""
            await healthy.some()
            healthy.check()

    asyncio.run(look())


def test_a_missing_signal_of_a_stopped_loop_is_named(
    scope: ScopeProcess, client: rtcf.Client
) -> None:
    async def look() -> None:
        async with Visit(scope, "still") as page:
            await page.say(watch=["/late.wave"])
            assert (await page.text("missing"))["names"] == ["/late.wave"]
            await asyncio.to_thread(client.load, _wave("late"), runner="still")
            assert (await page.text("missing"))["names"] == []
            await page.say(watch=["/late.none"])
            assert (await page.text("missing"))["names"] == ["/late.none"]

    client.add_runner("still")
    try:
        asyncio.run(look())
    finally:
        client.remove_runner("still")


def test_traces_above_the_limit_of_a_page_are_left_out_and_named(scope: ScopeProcess) -> None:
    async def look() -> None:
        async with Visit(scope) as page:
            await page.say(watch=["/wave.phase", *GHOSTS[:255], "/wave.wave", "/mimo.out1"])
            while not (missing := await page.text("missing"))["names"]:
                pass
            assert missing["over"] == ["/wave.wave", "/mimo.out1"]
            assert missing["names"] == GHOSTS[:255]
            assert missing["text"].endswith(
                "traces omitted above 256 per page: /wave.wave, /mimo.out1"
            )
            await page.binary(CYCLES, traces=1)
            await page.say(watch=["/wave.phase", "/wave.wave", "/mimo.out1"])
            await page.binary(CYCLES, traces=3)
            assert page.texts[-1]["kind"] == "watching" or page.texts[-1]["text"] == ""

    asyncio.run(look())


def test_all_pages_together_may_exceed_the_limit_of_a_page(scope: ScopeProcess) -> None:
    async def look() -> None:
        async with contextlib.AsyncExitStack() as pages:
            healthy = await pages.enter_async_context(_Healthy().watching(scope))
            others = [await pages.enter_async_context(Visit(scope)) for _ in range(5)]
            for number, page in enumerate(others):
                names = [f"/ghost{number}.out{each}" for each in range(250)]
                await page.say(watch=["/mimo.out1", *names, "/wave.wave"])
            for page in others:
                await page.binary(CYCLES, traces=2)
            await healthy.some()
            healthy.check()

    asyncio.run(look())


def test_a_trigger_on_a_missing_signal_waits_for_the_signal(
    scope: ScopeProcess, client: rtcf.Client
) -> None:
    async def look() -> None:
        async with Visit(scope) as page:
            for told in (
                {"kind": "nan", "signal": "/late.wave", "before": 1, "after": 1},
                LEVEL | {"signal": "/late.wave"},
                {"kind": "condition", "condition": "isnan(late.wave)", "before": 1, "after": 1},
            ):
                await page.say(watch=["/wave.phase"], trigger=told)
                armed = await page.text("trigger")
                assert (armed["state"], armed["signals"]) == ("armed", ["/late.wave"])
            # It may have come before the answer to the last trigger.
            assert (await page.told("missing"))["trigger"] == ["/late.wave"]
            for _ in range(20):
                assert (await page.binary(CYCLES))[0][0] == CYCLES
            await page.say(trigger=LEVEL | {"signal": "/late.wave", "single": True})
            await asyncio.to_thread(client.load, _wave("late"))
            try:
                await page.binary(SHOT)
                assert (await page.text("trigger"))["state"] == "done"
            finally:
                await asyncio.to_thread(client.unload, ["late"])

    asyncio.run(look())


def test_a_rejected_trigger_disarms_the_previous_one(scope: ScopeProcess) -> None:
    async def look() -> None:
        async with Visit(scope) as page:
            await page.say(
                watch=["/wave.phase"], trigger=LEVEL | {"signal": "/wave.wave", "low": 9}
            )
            assert (await page.text("trigger"))["state"] == "armed"
            await page.say(trigger=LEVEL | {"signal": ""})
            state = await page.text("trigger")
            assert (state["state"], state["refused"]) == (
                "off", "'' is not a signal: name one as in /wave.phase",
            )  # fmt: skip

    asyncio.run(look())


def test_a_missing_runner_is_reported_to_its_page_until_it_exists(
    scope: ScopeProcess, client: rtcf.Client
) -> None:
    async def look() -> None:
        async with _Healthy().watching(scope) as healthy, Visit(scope, "later") as page:
            await page.say(watch=["/wave.phase"])
            while "later" not in (await page.text("error"))["text"]:
                pass
            for _ in range(2):
                await asyncio.to_thread(client.add_runner, "later")
                await asyncio.to_thread(client.load, _wave("wave"), runner="later")
                await asyncio.to_thread(client.start, "later")
                await page.binary(CYCLES, traces=1)
                assert not [each for each in page.texts if each["kind"] == "error"][-1]["text"]
                await asyncio.to_thread(client.stop, "later")
                await asyncio.to_thread(client.unload, ["wave"], runner="later")
                await asyncio.to_thread(client.remove_runner, "later")
                while "later" not in (await page.text("error"))["text"]:
                    pass
            await healthy.some()
            healthy.check()

    asyncio.run(look())


class _Control:
    """A stream of the healthy page's signal that bypasses the scope."""

    def __init__(self, daemon: Daemon) -> None:
        self.lost = 0
        self._client = rtcf.Client(daemon.socket)
        self._stream = self._client.watch_ports(["/wave.phase"])
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> "_Control":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()
        self._thread.join()
        self._client.close()

    def _look(self) -> None:
        for batch in self._stream:
            self.lost += batch.lost


NAMES = st.lists(
    st.sampled_from(
        ["/wave.wave", "/wave.phase", "/mimo.out1", "/extra.wave", "/gone.x", "/wave.gone",
         "~latency", "/wave.phase[7]", "**", "/*.wave", "/wave", "wave.phase", "",
         "/wave.[a-z]*", "/\ud800.x",
         "/wave.phase\n", "/" + "w" * 3000 + ".x", "/a.b[" + "9" * 6000 + "]"]
    ),
    max_size=6,
)  # fmt: skip
TRIGGERS: st.SearchStrategy[Any] = st.sampled_from(
    [None, 3, {}, LEVEL | {"signal": "/wave.wave"}, LEVEL | {"signal": "/gone.x"},
     LEVEL | {"signal": "/extra.wave", "before": 5000, "after": 5000}, LEVEL | {"signal": "**"},
     {"kind": "nan", "signal": "/gone.x", "before": 0, "after": 1},
     {"kind": "condition", "condition": "isnan(gone.x) or wave.phase > 0", "before": 1, "after": 1},
     {"kind": "condition", "condition": "min(wave.phase) > 1", "before": 1, "after": 1},
     {"kind": "condition", "condition": "abs > wave.phase", "before": 1, "after": 1},
     {"kind": "condition", "condition": "wave > 1", "before": 1, "after": 1}]
)  # fmt: skip
PAGE = st.integers(0, 3)
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("open"), PAGE, st.sampled_from(["", "", "other", "nobody"])),
        st.tuples(st.just("close"), PAGE, st.none()),
        st.tuples(st.just("watch"), PAGE, NAMES),
        st.tuples(st.just("watch"), PAGE, st.just(GHOSTS)),
        st.tuples(st.just("arm"), PAGE, TRIGGERS),
        st.tuples(st.just("say"), PAGE, st.sampled_from(["", "{", "[" * 20_000, '{"watch": 3}'])),
        st.tuples(st.just("extra"), PAGE, st.none()),
        st.tuples(st.just("runner"), PAGE, st.sampled_from(["add", "start", "stop", "remove"])),
    ),
    min_size=3,
    max_size=15,
)  # fmt: skip


class _Others:
    """Pages besides the healthy one, and changes of components and of another runner."""

    def __init__(self, scope: ScopeProcess, client: rtcf.Client) -> None:
        self._scope = scope
        self._client = client
        self._pages: dict[int, tuple[Visit, ScopePage, asyncio.Task[None]]] = {}

    async def do(self, what: str, number: int, told: Any) -> None:
        """Run one step; errors do not matter."""
        if what == "open" and number not in self._pages:
            visit = Visit(self._scope, told)
            page = await visit.__aenter__()
            self._pages[number] = visit, page, asyncio.create_task(_hear(page))
        elif what == "close":
            await self._close(number)
        elif what == "extra":
            await self._try(self._change_graph)
        elif what == "runner":
            await self._try(lambda: self._change_runner(told))
        elif number in self._pages:
            _, page, _ = self._pages[number]
            if what == "say":
                await page.send(told)
            else:
                await page.say(**{"watch" if what == "watch" else "trigger": told})

    async def end(self) -> None:
        """Close all pages; restore the initial state."""
        for number in tuple(self._pages):
            await self._close(number)
        await self._try(lambda: self._client.unload(["extra"]))
        for what in ("stop", "remove"):
            await self._try(functools.partial(self._change_runner, what))

    async def _close(self, number: int) -> None:
        if number not in self._pages:
            return
        visit, _, hearing = self._pages.pop(number)
        hearing.cancel()
        await asyncio.gather(hearing, return_exceptions=True)
        await visit.__aexit__()

    async def _try(self, what: Callable[[], object]) -> None:
        with contextlib.suppress(rtcf.RtcfError):
            await asyncio.to_thread(what)

    def _change_graph(self) -> None:
        if any(each.full_name == "/extra" for each in self._client.list_components()):
            self._client.unload(["extra"])
        else:
            self._client.load(_wave("extra"))

    def _change_runner(self, what: str) -> None:
        if what == "add":
            self._client.add_runner("other")
            self._client.load(_wave("wave"), runner="other")
        elif what == "start":
            self._client.start("other")
        elif what == "stop":
            self._client.stop("other")
        else:
            self._client.stop("other")
            self._client.unload(["wave"], runner="other")
            self._client.remove_runner("other")


async def _hear(page: ScopePage) -> None:
    while True:
        await page.binary(CYCLES)


def _check(loop: Daemon, scope: ScopeProcess, steps: list[tuple[str, int, Any]]) -> None:
    async def look() -> None:
        with rtcf.Client(loop.socket) as client, _Control(loop) as control:
            others = _Others(scope, client)
            try:
                async with _Healthy().watching(scope) as healthy:
                    for step in steps:
                        await others.do(*step)
                    await healthy.some()
                    await others.end()
                    await healthy.some()
                # A stalled machine loses cycles in every stream.
                if not control.lost:
                    healthy.check()
            finally:
                await others.end()

    asyncio.run(look())
    said = scope.log.read_text()
    assert "Traceback" not in said and "failed" not in said


def _seeded(most: int) -> Callable[[Any], Any]:
    chosen = hypothesis.settings(
        max_examples=most, suppress_health_check=list(hypothesis.HealthCheck), print_blob=False
    )
    return lambda test: hypothesis.seed(SEED)(chosen(test))


@_seeded(40)
@hypothesis.given(steps=STEPS)
@hypothesis.example(
    steps=[("open", 0, ""), ("watch", 0, GHOSTS), ("arm", 0, LEVEL | {"signal": "/gone.x"})]
)
def test_other_pages_do_not_affect_a_healthy_page(
    loop: Daemon, scope: ScopeProcess, steps: list[tuple[str, int, Any]]
) -> None:
    _check(loop, scope, steps)


@pytest.mark.long
@_seeded(100)
@hypothesis.given(steps=STEPS)
def test_other_pages_do_not_affect_a_healthy_page_for_long(
    loop: Daemon, scope: ScopeProcess, steps: list[tuple[str, int, Any]]
) -> None:
    _check(loop, scope, steps)
