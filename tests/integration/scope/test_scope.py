"""The scope's server: access, and the data that pages receive."""

import asyncio
import contextlib
import http.client
import json
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rtcf
from daemon_process import DEADLINE_S, Daemon, wait_for
from scope_process import ScopeProcess, looping
from scope_visit import CYCLES, HEAD, SHOT, Visit


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Yield a daemon with a running loop, shared by all tests here."""
    components = [
        rtcf.component("rtcf_examples", "Wave", name="wave", parameters=["rate:=1.0"]),
        rtcf.component("rtcf_examples", "Mimo", name="mimo"),
    ]
    with looping(tmp_path_factory.mktemp("loop"), components) as daemon:
        yield daemon


@pytest.mark.parametrize("path", ["/api/about", "/api/graph", "/api/mcap", "/stream", "/nowhere"])
def test_without_the_token_no_data_is_sent(scope: ScopeProcess, path: str) -> None:
    for token in ("", "x" * len(scope.token), scope.token[:-1]):
        status, text = scope.ask(path, token=token)
        assert (status, text.decode()) == (
            403, "access requires the token: open the address that rtcfctl scope printed\n",
        )  # fmt: skip
    assert scope.ask(f"{path}?token={scope.token}", token="")[0] == 403


def test_the_page_itself_needs_no_token(scope: ScopeProcess) -> None:
    for path, text in (("/", b"<title>rtcf scope</title>"), ("/page/main.js", b"import")):
        status, said = scope.ask(path, token="")
        assert status == 200 and text in said


def test_a_page_without_the_token_of_a_file_names_the_file(loop: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "token"
    with ScopeProcess(loop, "--token-file", str(file)) as scope:
        status, text = scope.ask("/api/about", token="")
    assert (status, text.decode()) == (
        403, "access requires the token: open http://HOST:PORT/?token=TOKEN "
        f"with the token in {file}\n",
    )  # fmt: skip


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "["])
def test_a_foreign_host_name_is_rejected(scope: ScopeProcess, host: str) -> None:
    status, text = scope.ask("/api/about", Host=host)
    assert (status, text.decode()) == (403, f"unknown host name {host}: allow it with --name\n")
    for ours in (f"localhost:{scope.port}", f"[::1]:{scope.port}", "127.0.0.1:1"):
        assert scope.ask("/api/about", Host=ours)[0] == 200


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1"])
def test_pages_of_other_origins_are_rejected(scope: ScopeProcess, origin: str) -> None:
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket"}
    asked: list[tuple[str, dict[str, str]]] = [("/api/about", {}), ("/stream", upgrade)]
    for path, headers in asked:
        status, text = scope.ask(path, Origin=origin, **headers)
        assert (status, text.decode()) == (403, f"requests from pages of {origin} are rejected\n")


@pytest.mark.parametrize(
    "path",
    ["/page/../site.py", "/page/%2e%2e/site.py", "/page/..%2fsite.py", "/page//etc/passwd",
     "/../../etc/passwd", "/page/....//site.py", "/page/%00"],
)  # fmt: skip
def test_no_path_leads_out_of_the_page(scope: ScopeProcess, path: str) -> None:
    status, text = scope.ask(path)
    assert status in (400, 404)
    assert b"aiohttp" not in text and b"root:" not in text


@pytest.mark.parametrize("name", ["..", "%2e%2e%2fa", "..%2f..%2fetc%2fpasswd", ".a", "a%00b"])
def test_layouts_and_recordings_have_names_not_paths(scope: ScopeProcess, name: str) -> None:
    for path in (f"/api/layouts/{name}", f"/api/recordings/{name}"):
        status, text = scope.ask(path)
        assert status in (400, 404) and b"root:" not in text
    assert scope.ask(f"/api/layouts/{name}", "PUT", "{}")[0] in (400, 404, 405)


def test_a_layout_is_kept_until_it_is_removed(scope: ScopeProcess) -> None:
    assert scope.told("/api/layouts") == []
    scope.told("/api/layouts/my%20arm", "PUT", '{"span": 5}')
    assert scope.told("/api/layouts") == ["my arm"]
    assert scope.told("/api/layouts/my%20arm") == {"span": 5}
    status, text = scope.ask("/api/layouts/b", "PUT", "{")
    assert status == 400 and b"layout b is not JSON" in text
    status, text = scope.ask("/api/layouts/b", "PUT", json.dumps("x" * 70_000))
    assert (status, json.loads(text)) == (400, {"refused": "a layout can have at most 65536 bytes"})
    scope.told("/api/layouts/my%20arm", "DELETE")
    assert scope.told("/api/layouts") == []
    status, text = scope.ask("/api/layouts/my%20arm")
    assert (status, json.loads(text)) == (400, {"refused": "no layout my arm"})


def test_a_flood_of_connections_is_rejected_and_survived(scope: ScopeProcess) -> None:
    flood = [socket.create_connection(("127.0.0.1", scope.port)) for _ in range(200)]
    try:
        # Connections without a token are closed to make room for another one.
        wait_for(lambda: _answers(scope), "room for another connection")
        assert all(_is_closed(each) for each in flood)
    finally:
        for each in flood:
            each.close()


def test_connections_with_the_token_are_limited_too(loop: Daemon) -> None:
    with ScopeProcess(loop) as scope, contextlib.ExitStack() as stack:
        for _ in range(128):
            tab = stack.enter_context(
                contextlib.closing(http.client.HTTPConnection("127.0.0.1", scope.port, DEADLINE_S))
            )
            tab.request("GET", "/api/layouts", headers={"Authorization": f"Bearer {scope.token}"})
            answer = tab.getresponse()
            assert answer.read() and answer.status == 200
        with socket.create_connection(("127.0.0.1", scope.port), DEADLINE_S) as another:
            assert b"503" in another.recv(200)


def _is_closed(connection: socket.socket) -> bool:
    connection.settimeout(DEADLINE_S)
    try:
        answer = connection.recv(200)
    except ConnectionResetError:
        return True
    return not answer or b"503" in answer


def _answers(scope: ScopeProcess) -> bool:
    try:
        return scope.ask("/api/about")[0] == 200
    except OSError:
        return False


def test_without_the_right_parameters_cannot_be_set(scope: ScopeProcess) -> None:
    change = json.dumps({"component": "/wave", "parameter": "rate", "value": 2.0})
    status, text = scope.ask("/api/parameter", "POST", change)
    assert (status, json.loads(text)) == (
        400,
        {"refused": "the scope is read-only: start it with --right tune to set parameters"},
    )


def test_with_the_right_parameters_are_set_within_their_bounds(
    loop: Daemon,
) -> None:
    with (
        ScopeProcess(loop, "--right", "tune") as scope,
        rtcf.Client(loop.socket) as client,
    ):

        def change(component: str, parameter: str, value: Any) -> str:
            told = {"component": component, "parameter": parameter, "value": value}
            status, text = scope.ask("/api/parameter", "POST", json.dumps(told))
            return "" if status == 200 else str(json.loads(text)["refused"])

        assert change("/wave", "rate", 2) == ""
        (rate,) = (p for p in client.get_component("/wave").parameters if p.name == "rate")
        assert rate.value.double_value == 2.0
        assert change("/wave", "shape", "square") == ""
        assert "1000" in change("/wave", "rate", 2000)
        assert change("/wave", "rate", "fast") == "rate has type double: invalid value 'fast'"
        assert change("/wave", "size", 1) == "/wave has no parameter size"
        assert "/nobody" in change("/nobody", "size", 1)
        assert scope.ask("/api/parameter", "POST", "[1]")[0] == 400
        first = scope.told("/api/history")[0]
        assert (first["component"], first["value"], first["how"]) == ("/wave", "square", "set")
        assert first["who"]


def test_tabs_share_one_stream_and_miss_no_cycle_when_another_comes(scope: ScopeProcess) -> None:
    async def look() -> None:
        async with Visit(scope) as first:
            await first.say(watch=["/wave.phase"])
            seen, lost = [], 0.0
            head, columns = await first.binary(CYCLES, traces=1)
            seen.append(columns)
            async with Visit(scope) as second:
                # Other signals are watched from here on.
                await second.say(watch=["/wave.wave", "/mimo.out1"])
                while len(seen) < 40:
                    head, columns = await first.binary(CYCLES)
                    assert columns.shape[0] == 5
                    lost += head[6]
                    seen.append(columns)
                # The start of the stream with both pages' signals.
                await second.binary(CYCLES, traces=2)
            cycles = np.hstack([each[1] for each in seen])
            assert np.all(np.diff(cycles) >= 1)
            assert cycles[-1] - cycles[0] + 1 == len(cycles) + lost
            phase = np.hstack([each[4] for each in seen])
            assert np.isfinite(phase).all() and phase.min() >= 0.0 and phase.max() < 1.0

    asyncio.run(look())


def test_events_and_log_records_are_sent(loop: Daemon, scope: ScopeProcess) -> None:
    def tune(amplitude: str) -> None:
        with rtcf.Client(loop.socket) as client:
            client.set_parameters("wave", [rtcf.parse_parameter(f"amplitude:={amplitude}")])

    async def visit() -> list[dict[str, Any]]:
        async with Visit(scope) as page:
            await page.text("state")
            await asyncio.to_thread(tune, "9.5")
            await page.text("event")
            while not any(each.get("what") == "warn" for each in page.texts):
                await page.text("record")
            return page.texts

    try:
        texts = asyncio.run(visit())
    finally:
        tune("1.0")
    (event,) = (each for each in texts if each["kind"] == "event")
    assert (event["what"], event["component"]) == ("parameters", "/wave")
    (record,) = (each for each in texts if each["kind"] == "record" and each["what"] == "warn")
    assert (record["component"], record["message"]) == ("/wave", "amplitude 9.5 is large")
    assert record["iteration"] > 0


def test_a_trigger_shows_its_cycle_and_the_neighbouring_ones(
    scope: ScopeProcess,
) -> None:
    async def look() -> None:
        async with Visit(scope) as page:
            await page.say(watch=["/wave.phase"])
            for _ in range(10):  # cycles before the hit
                await page.binary(CYCLES)
            await page.say(
                trigger={"kind": "edge", "signal": "/wave.phase", "slope": "falling", "low": 0.5,
                         "before": 30, "after": 20, "single": True},
            )  # fmt: skip
            head, columns = await page.binary(SHOT)
            hit, phase = int(head[7]), columns[4]
            assert (hit, columns.shape) == (30, (5, 50))
            assert phase[hit - 1] > 0.5 >= phase[hit]
            assert (await page.text("trigger"))["state"] == "done"
            # A single trigger hits once: the next falling edge, a second later, sends no shot.
            for _ in range(80):
                assert (await page.binary(CYCLES))[0][0] == CYCLES

    asyncio.run(look())


def test_a_trigger_on_several_signals_shows_its_cycle(scope: ScopeProcess) -> None:
    async def look() -> None:
        async with Visit(scope) as page:
            await page.say(
                watch=["/wave.phase", "/wave.wave"],
                trigger={"kind": "condition", "condition": "wave.phase > 0.5 and wave.wave < -0.9",
                         "before": 10, "after": 10, "single": True},
            )  # fmt: skip
            head, columns = await page.binary(SHOT)
            hit, phase, wave = int(head[7]), columns[4], columns[5]
            assert phase[hit] > 0.5 and wave[hit] < -0.9
            assert wave[hit - 1] >= -0.9

    asyncio.run(look())


@pytest.mark.parametrize(
    ("told", "said"),
    [
        (
            {"trigger": {"kind": "condition", "condition": "a.x >", "before": 1, "after": 1}},
            '"a.x >" is not a condition: write one as in `wave.phase > 0.5`',
        ),
        ({"trigger": 3}, "a trigger needs signal, kind, before and after"),
        (
            {"trigger": {"kind": "loud"}},
            "trigger kind 'loud': must be one of edge, level, window, nan, condition",
        ),
        (
            {"trigger": {"kind": "window", "signal": "/wave.wave", "low": 2, "high": 1,
                         "before": 1, "after": 1}},
            "window from 2 to 1: low must be below high",
        ),
        (
            {"trigger": {"kind": "nan", "signal": "/wave.wave", "before": 1, "after": 1_000_000}},
            "a trigger shows at most 200000 cycles",
        ),
        (
            {"trigger": {"kind": "edge", "signal": "wave", "before": 1, "after": 1}},
            "'wave' is not a signal: name one as in /wave.phase",
        ),
        (
            {"trigger": {"kind": "condition", "condition": "min(wave.wave) > 1", "before": 1,
                         "after": 1}},
            "min() takes 2 values",
        ),
        ({"watch": "/wave.wave"}, "watch must be a list of signal names"),
    ],
)  # fmt: skip
def test_forbidden_requests_of_a_page_are_rejected_in_one_line(
    scope: ScopeProcess, told: dict[str, Any], said: str
) -> None:
    async def ask() -> str:
        async with Visit(scope) as page:
            await page.say(**told)
            return str((await page.text("refused"))["text"])

    assert asyncio.run(ask()) == said


def test_a_page_that_does_not_read_blocks_nobody(scope: ScopeProcess) -> None:
    async def look() -> None:
        async with Visit(scope) as slow, Visit(scope) as quick:
            for page in (slow, quick):
                await page.say(watch=["/wave.phase"])
            head, columns = await quick.binary(CYCLES, traces=1)
            for _ in range(60):
                head, columns = await quick.binary(CYCLES)
                assert columns.shape == (5, head[3])

    asyncio.run(look())


def test_the_last_cycles_can_be_saved_as_a_recording(scope: ScopeProcess, tmp_path: Path) -> None:
    async def look() -> tuple[float, float]:
        async with Visit(scope) as page:
            await page.say(watch=["/wave.phase"])
            _, first = await page.binary(CYCLES, traces=1)
            for _ in range(10):
                _, last = await page.binary(CYCLES)
            return first[1][0], last[1][-1]

    first, last = asyncio.run(look())
    status, data = scope.ask(f"/api/mcap?first={first:.0f}&last={last:.0f}")
    assert status == 200
    file = tmp_path / "had.mcap"
    file.write_bytes(data)
    with rtcf.read_recording(file) as recording:
        assert set(recording.signals) >= {"/wave.phase"}
        cycles = recording.cycles
    assert cycles[0] <= first and cycles[-1] >= last
    assert scope.ask("/api/mcap?first=1e15&last=2e15")[0] == 400


def test_recordings_are_sent_unchanged(loop: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    done = loop.ctl("record", "-o", str(file), "wave", "--duration", "0.3s")
    assert done.returncode == 0, done.stderr
    with ScopeProcess(loop, str(file)) as scope, rtcf.read_recording(file) as recording:
        assert scope.told("/api/recordings") == ["run.mcap"]
        told = scope.told("/api/recordings/run.mcap")
        assert {each["name"] for each in told["signals"]} == set(recording.signals)
        status, data = scope.ask("/api/recordings/run.mcap/columns?trace=/wave.phase&trace=/no.one")
        assert status == 200
        head = HEAD.unpack_from(data)
        columns = np.frombuffer(data[HEAD.size :]).reshape(head[4], head[3])
        assert np.array_equal(columns[1], recording.cycles)
        assert np.array_equal(columns[4], recording["/wave.phase"])
        assert np.isnan(columns[5]).all()
        status, text = scope.ask("/api/recordings/other.mcap")
        assert (status, json.loads(text)["refused"]) == (
            400, "no recording other.mcap: start the scope with this file",
        )  # fmt: skip


def test_tabs_that_are_killed_leave_nothing(loop: Daemon, scope: ScopeProcess) -> None:
    rtcfd = Path(f"/proc/{loop.pid}/fd")
    scopes = Path(f"/proc/{scope.process.pid}/fd")

    async def one() -> None:
        async with Visit(scope) as page:
            await page.say(watch=["/wave.phase"])
            await page.binary(CYCLES)

    async def many() -> None:
        pages = [Visit(scope) for _ in range(20)]
        for each in pages:
            page = await each.__aenter__()
            await page.say(watch=["/wave.phase", "/mimo.out1"])
            await page.binary(CYCLES)
        for each in pages:
            # No closing handshake, as when a browser is killed.
            for connection in each.http.connector._conns.values():  # type: ignore[union-attr]
                for protocol, _ in connection:
                    protocol.transport.abort()  # type: ignore[union-attr]
            await each.__aexit__()

    asyncio.run(one())
    before = [len(os.listdir(folder)) for folder in (rtcfd, scopes)]
    asyncio.run(many())
    wait_for(
        lambda: all(
            len(os.listdir(folder)) <= count
            for folder, count in zip((rtcfd, scopes), before, strict=True)
        ),
        "nothing left of the tabs",
    )


def test_over_ssh_the_tunnel_command_is_printed(
    loop: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SSH_CONNECTION", "10.0.0.2 50000 10.0.0.1 22")
    monkeypatch.setenv("USER", "alice")
    with ScopeProcess(loop) as scope:
        wait_for(lambda: "ssh" in scope.log.read_text(), "the tunnel command")
        said = scope.log.read_text().splitlines()[1]
    assert said == (
        f"from your machine:  ssh -N -L {scope.port}:127.0.0.1:{scope.port} alice@10.0.0.1"
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--port", "99999"], "rtcfctl: --port 99999: must be from 0 to 65535"),
        (["/nowhere.mcap"], "rtcfctl: /nowhere.mcap: no such file"),
        (["--address", "192.0.2.1"], "choose another --port"),
        (["--token-file", "/dev/null"], "rtcfctl: /dev/null: a token needs at least 16 letters"),
    ],
)
def test_a_wrong_command_line_is_rejected(loop: Daemon, arguments: list[str], said: str) -> None:
    done = loop.ctl("scope", *arguments)
    assert done.returncode in (1, 2)
    assert said in done.stderr and done.stderr.count("\n") == 1
