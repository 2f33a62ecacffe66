"""Access to the scope: its token, its sessions, and invalid requests."""

import asyncio
import http.server
import os
import re
import socket
import stat
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit
from urllib.request import url2pathname

import aiohttp
import hypothesis
import pytest
import rtcf
from browser import Browser, Page
from daemon_process import DEADLINE_S, Daemon, wait_for
from hypothesis import strategies as st
from scope_process import ScopeProcess, looping

SEED = int(os.environ.get("RTCF_SEED", "1"))
NOBODY = 65534
LAYOUT = '{"panes":[{"traces":["/wave.wave"]}],"span":2}'


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """Yield a daemon with a running loop, shared by all tests here."""
    components = [rtcf.component("rtcf_examples", "Wave", name="wave", parameters=["rate:=1.0"])]
    with looping(tmp_path_factory.mktemp("loop"), components) as daemon:
        yield daemon


@pytest.fixture(scope="module")
def scope(loop: Daemon) -> Iterator[ScopeProcess]:
    with ScopeProcess(loop, "--right", "tune") as scope:
        yield scope


@pytest.fixture
def chromium(tmp_path: Path) -> Iterator[Browser]:
    with Browser(tmp_path / "browser") as browser:
        yield browser


# Sessions


def test_the_token_gives_a_session_that_replaces_it(scope: ScopeProcess) -> None:
    first, second = scope.session(), scope.session()
    assert len({first, second, scope.token}) == 3
    for session in (first, second):
        assert scope.ask("/api/about", token=session)[0] == 200
        # A session cannot open another session.
        assert scope.ask("/api/session", "POST", token=session)[0] == 403
    assert scope.ask("/api/session", "POST", token=scope.token[:-1])[0] == 403
    assert scope.ask("/api/session", "POST", token="")[0] == 403


def test_a_session_opens_a_stream_and_a_cookie_opens_nothing(scope: ScopeProcess) -> None:
    session = scope.session()
    address = f"http://127.0.0.1:{scope.port}"

    async def connect(**words: Any) -> int:
        async with aiohttp.ClientSession() as http:
            try:
                async with http.ws_connect(f"{address}/stream", origin=address, **words) as socket:
                    assert socket.protocol == "rtcf-scope"
                    return 101
            except aiohttp.WSServerHandshakeError as error:
                return error.status

    asked = {"protocols": ("rtcf-scope", f"session.{session}")}
    assert asyncio.run(connect(**asked)) == 101
    asked["protocols"] = ("rtcf-scope", f"session.{session[:-1]}")
    assert asyncio.run(connect(**asked)) == 403
    for secret in (scope.token, session):
        for name in ("session", "token", f"rtcf_scope_{scope.port}"):
            asked_with = {"Cookie": f"{name}={secret}"}
            assert asyncio.run(connect(headers=asked_with)) == 403
            assert scope.ask("/api/about", token="", **asked_with)[0] == 403


def test_a_session_ends_with_its_server(loop: Daemon, tmp_path: Path) -> None:
    kept = ("--token-file", str(tmp_path / "token"))
    with ScopeProcess(loop, *kept) as before:
        session, port = before.session(), before.port
    token = (tmp_path / "token").read_text().strip()
    with ScopeProcess(loop, *kept, "--port", str(port)) as after:
        assert after.ask("/api/about", token=token)[0] == 200
        assert after.ask("/api/about", token=session)[0] == 403


# The browser


def _kept(page: Page) -> str:
    return str(page.ask("localStorage.getItem('session')"))


def test_the_token_leaves_the_address_and_the_layout_stays(
    chromium: Browser, scope: ScopeProcess
) -> None:
    page = chromium.page(f"{scope.address}#{quote(LAYOUT)}")
    page.wait("scope.live.end > 10")
    assert page.ask("location.search") == ""
    assert page.ask("document.cookie") == "" and page.ask("document.referrer") == ""
    assert page.ask("scope.traces().map((each) => each.name)") == ["/wave.wave"]
    history = page.call("Page.getNavigationHistory")["entries"]
    assert not [each for each in history if scope.token in each["url"]]
    assert page.ask("JSON.parse(decodeURIComponent(location.hash.slice(1))).span") == 2
    assert _kept(page) not in ("", scope.token)
    # A bookmark with the layout opens with the session, in any tab.
    marked = chromium.page(f"http://127.0.0.1:{scope.port}/#{quote(LAYOUT)}")
    marked.wait("scope.live.end > 10 && document.getElementById('error').hidden")
    assert page.errors == marked.errors == []


def test_a_page_without_a_session_explains_how_to_get_one(
    chromium: Browser, scope: ScopeProcess
) -> None:
    page = chromium.page(f"http://127.0.0.1:{scope.port}/#{quote(LAYOUT)}")
    page.wait(
        "document.getElementById('error').textContent === "
        "'access requires the token: open the address that rtcfctl scope printed'"
    )
    # It continues once another tab has a session.
    chromium.page(scope.address).wait("scope.rate")
    page.wait("scope.live.end > 10 && document.getElementById('error').hidden")
    assert page.ask("scope.traces().length") == 1


def test_a_page_of_a_restarted_server_explains_how_to_continue(
    chromium: Browser, loop: Daemon, tmp_path: Path
) -> None:
    kept = ("--token-file", str(tmp_path / "token"))
    with ScopeProcess(loop, *kept) as before:
        page = chromium.page(f"{before.address}#{quote(LAYOUT)}")
        page.wait("scope.live.end > 10")
    page.wait("document.getElementById('error').textContent.includes('no connection')")
    with ScopeProcess(loop, *kept, "--port", str(before.port)) as after:
        page.wait("document.getElementById('error').textContent.includes('requires the token')")
        chromium.page(after.address).wait("scope.rate")
        page.wait("document.getElementById('error').hidden")


class _Recorder:
    """A server on another port of this host that stores all requests."""

    def __init__(self, script: str) -> None:
        self.got: list[str] = []
        recorder = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                recorder.got.append(f"{self.path}\n{self.headers}")
                page = f"<!doctype html><script>{script}</script>".encode()
                self.send_response(200)
                self.send_header("Content-Type", "text/html")
                self.send_header("Content-Length", str(len(page)))
                self.end_headers()
                self.wfile.write(page)

            def log_message(self, *_: object) -> None:
                pass

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.address = f"http://127.0.0.1:{self._server.server_address[1]}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


def test_another_port_of_the_host_gets_no_secret_and_no_access(
    chromium: Browser, scope: ScopeProcess
) -> None:
    ours = f"http://127.0.0.1:{scope.port}"
    recorder = _Recorder(
        f"""
        const tried = [];
        window.done = (async () => {{
          for (const mode of ["cors", "no-cors"])
            tried.push(await fetch("{ours}/api/about", {{ mode, credentials: "include" }})
              .then((answer) => answer.text(), (error) => "refused"));
          tried.push(await new Promise((told) => {{
            const socket = new WebSocket("ws://127.0.0.1:{scope.port}/stream");
            socket.onopen = () => told("open");
            socket.onerror = () => told("refused");
          }}));
          return [...tried, document.cookie, document.referrer, localStorage.length, name];
        }})();
        """
    )
    try:
        page = chromium.page(f"{scope.address}#{quote(LAYOUT)}")
        page.wait("scope.live.end > 10")
        secrets = [scope.token, _kept(page)]
        page.ask(f"void (location.href = '{recorder.address}/by-script')")
        page.wait("window.done")
        assert page.ask("done") == ["refused", "refused", "refused", "", "", 0, ""]
        # And back from a page of the scope.
        page.ask(f"void (location.href = '{ours}/')")
        page.wait("scope.rate")
        page.ask(
            f"const link = document.createElement('a'); link.href = '{recorder.address}/by-link';"
            "document.body.append(link); link.click()"
        )
        page.wait("location.pathname === '/by-link' && window.done")
    finally:
        recorder.close()
    paths = [each.split("\n")[0] for each in recorder.got]
    assert {"/by-script", "/by-link"} <= set(paths)
    for got in recorder.got:
        assert not [secret for secret in secrets if secret in got]
        assert "Cookie" not in got and f"Referer: {ours}" not in got


def _command_lines() -> str:
    """Return all command lines of processes that the user nobody can read."""
    look = "cat /proc/[0-9]*/cmdline 2>/dev/null | tr '\\0' ' '; ps -eo args 2>/dev/null; true"
    user: dict[str, Any] = {"user": NOBODY, "group": NOBODY} if os.geteuid() == 0 else {}
    done: subprocess.CompletedProcess[str] = subprocess.run(
        ["sh", "-c", look], capture_output=True, text=True, errors="replace", check=True, **user
    )
    return done.stdout


def test_another_user_sees_no_token_when_a_browser_is_opened(
    loop: Daemon, tmp_path: Path, chromium: Browser
) -> None:
    run = tmp_path / "run"
    run.mkdir(mode=0o700)
    script, said = tmp_path / "browser.sh", tmp_path / "said"
    os.mkfifo(tmp_path / "wait")
    script.write_text(
        f'#!/bin/sh\necho "$$ $@" > {said}.new; mv {said}.new {said}; read line < {tmp_path}/wait\n'
    )
    script.chmod(0o755)
    display = {"DISPLAY": ":99", "BROWSER": str(script), "XDG_RUNTIME_DIR": str(run)}
    with ScopeProcess(loop, display=display) as scope:
        wait_for(said.exists, "the browser")
        pid, address = said.read_text().split()
        try:
            seen = _command_lines()
            assert str(script) in seen and address in seen
            file = Path(url2pathname(urlsplit(address).path))
            ticket = file.read_text().split("token=")[1].split('"')[0]
            assert ticket != scope.token
            assert scope.token not in seen and ticket not in seen
            assert stat.S_IMODE(file.stat().st_mode) == 0o600
            assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700
            assert file.is_relative_to(run)
            # It opens the page, but only once.
            page = chromium.page(address)
            page.wait("scope.rate")
            assert page.ask("location.search") == ""
            wait_for(lambda: not file.parent.exists(), "the removal of the file")
            assert scope.ask("/api/session", "POST", token=ticket)[0] == 403
        finally:
            subprocess.run(["kill", pid], check=False)
    assert list(run.iterdir()) == []


def test_an_unread_token_file_is_removed_with_the_scope(loop: Daemon, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir(mode=0o700)
    display = {"DISPLAY": ":99", "BROWSER": "/bin/true", "XDG_RUNTIME_DIR": str(run)}
    with ScopeProcess(loop, display=display):
        wait_for(lambda: len(list(run.iterdir())) == 1, "the file")
    assert list(run.iterdir()) == []


# Requests


def _request(line: bytes, *headers: bytes, body: bytes = b"") -> bytes:
    return b"\r\n".join([line, *headers, b"", body])


def _good(scope: ScopeProcess, path: bytes = b"/api/about", method: bytes = b"GET") -> list[bytes]:
    return [method + b" " + path + b" HTTP/1.1", b"Host: 127.0.0.1", b"Connection: close",
            b"Authorization: Bearer " + scope.token.encode()]  # fmt: skip


def _is_in_order(scope: ScopeProcess, data: bytes, patience_s: float = DEADLINE_S) -> int:
    """Fail if an answer is an internal error, or not one line; return its status."""
    status, body = scope.raw(data, patience_s)
    if status >= 400:
        assert status < 500, (data, body)
        assert len(body.strip().splitlines()) <= 1, (data, body)
        assert len(body) < 1000
    _is_calm(scope, data)
    return status


def _is_calm(scope: ScopeProcess, data: bytes) -> None:
    log = scope.news()
    assert not re.search("Traceback|failed|Fatal|Unhandled|protocols", log), (data, log)


DEEP = b"[" * 60_000


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda _: [b"GET /api/about HTTP/1.1", b"Host: 127.0.0.1",
                    b"Authorization: Bearer \xff"], 403),
        (lambda _: [b"GET /api/about HTTP/1.1", b"Host: 127.0.0.1", b"Authorization: \xff"], 403),
        (lambda _: [b"GET /api/about HTTP/1.1", b"Host: 127.0.0.1", b"Cookie: a=\xff"], 403),
        (lambda _: [b"GET /stream HTTP/1.1", b"Host: 127.0.0.1", b"Connection: Upgrade",
                    b"Upgrade: websocket", b"Sec-WebSocket-Protocol: session.\xff"], 403),
        (lambda _: [b"GET / HTTP/1.1", b"Host: \xff"], 403),
        (lambda _: [b"GET / HTTP/1.1", b"Host: 127.0.0.1:\xc3"], 403),
        (lambda _: [b"GET / HTTP/1.1", b"Host: [::1"], 403),
        (lambda _: [b"GET / HTTP/1.1", b"Host: 127.0.0.1", b"Origin: \xff\xfe"], 403),
        (lambda _: [b"GET / HTTP/1.0"], 403),
        (lambda _: [b"GET / HTTP/1.1", b"Host: 127.0.0.1", b"Expect: \xff"], 417),
        (lambda _: [b"GET /nowhere HTTP/1.1", b"Host: 127.0.0.1", b"Expect: more"], 417),
        (lambda scope: _good(scope, b"/api/graph?runner=%ff"), 400),
        (lambda scope: _good(scope, b"/api/graph?runner=\xff"), 400),
        (lambda scope: _good(scope, b"/api/component?name=%00&runner=%zz%"), 400),
        (lambda scope: _good(scope, b"/api/mcap?first=1e999&last=nan&runner=%ED%A0%80"), 400),
        (lambda scope: _good(scope, b"/api/mcap?first=" + b"9" * 5000), 400),
        (lambda scope: _good(scope, b"/api/mcap?first=x"), 400),
        (lambda scope: _good(scope, b"/api/layouts/" + b"%F0%9D%92%9C" * 64), 400),
        (lambda scope: _good(scope, b"/api/recordings/%ff/columns?trace=%ff"), 400),
        (lambda scope: _good(scope, b"/api/nowhere"), 404),
        (lambda scope: _good(scope, b"/api/nowhere\xff"), (400, 404)),
        (lambda scope: _good(scope, b"/page/main.js\xff"), (400, 404)),
        (lambda scope: _good(scope, b"/page/%ff%0a"), 404),
        (lambda scope: _good(scope, b"/api/about", b"DELETE"), 405),
        (lambda scope: _good(scope, b"/stream"), 400),
        (lambda scope: [*_good(scope, b"/stream"), b"Upgrade: websocket"], 400),
        (lambda scope: [*_good(scope, b"/stream"), b"Upgrade: websocket", b"Sec-WebSocket-Key: x",
                        b"Sec-WebSocket-Version: 13"], 400),
        (lambda scope: [*_good(scope), b"X: " + b"y" * 20_000], 400),
        (lambda scope: [*_good(scope), *(b"X%d: y" % each for each in range(30_000))], None),
        (lambda scope: [*_good(scope), b"no header"], 400),
        (lambda scope: [*_good(scope), b"Content-Length: -1"], 400),
        (lambda _: [b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"], 400),
        (lambda _: [b"GET  HTTP/1.1"], 400),
        (lambda _: [b"GET http://[/ HTTP/1.1", b"Host: 127.0.0.1"], None),
        (lambda _: [b"GET //[ HTTP/1.1", b"Host: 127.0.0.1"], None),
        (lambda _: [b"GET /" + b"a" * 100_000 + b" HTTP/1.1", b"Host: 127.0.0.1"], 400),
    ],
)  # fmt: skip
def test_invalid_requests_are_rejected_in_one_line(
    scope: ScopeProcess,
    make: Callable[[ScopeProcess], list[bytes]],
    expected: int | tuple[int, int] | None,  # of aiohttp in Debian 13 and 12; None: any
) -> None:
    status = _is_in_order(scope, _request(*make(scope)))
    if expected is not None:
        assert status in (expected if isinstance(expected, tuple) else (expected,))


@pytest.mark.parametrize("encoding", [b"br", b"gzip", b"deflate"])
def test_an_invalid_body_that_nobody_reads_is_not_logged(
    scope: ScopeProcess, encoding: bytes
) -> None:
    headers = [b"Host: 127.0.0.1", b"Content-Encoding: " + encoding, b"Content-Length: 9"]
    head = _request(b"GET / HTTP/1.1", *headers)
    with socket.create_connection(("127.0.0.1", scope.port), DEADLINE_S) as client:
        client.sendall(head)
        assert client.recv(4096).startswith(b"HTTP/1.1")
        client.sendall(b"no stream")  # after the response
        while client.recv(65536):
            pass
    _is_calm(scope, head)


@pytest.mark.parametrize(
    ("method", "path", "body", "kind", "expected"),
    [
        (b"PUT", b"/api/layouts/deep", DEEP, b"application/json", 400),
        (b"PUT", b"/api/layouts/deep", b"\xff\xfe", b"application/json", 400),
        (b"PUT", b"/api/layouts/" + b"%F0%9D%92%9C" * 64, b"{}", b"application/json", 400),
        (b"PUT", b"/api/layouts/big", b"9" * 60_000, b"application/json", 400),
        (b"PUT", b"/api/layouts/huge", b"[" + b"1," * 200_000, b"application/json", 413),
        (b"POST", b"/api/parameter", DEEP, b"application/json", 400),
        (b"POST", b"/api/parameter", b'{"component":"\\ud800","parameter":"\\ud800","value":1}',
         b"application/json", 400),
        (b"POST", b"/api/parameter", b'{"component":["/wave"],"parameter":{},"value":[]}',
         b"application/json", 400),
        (b"POST", b"/api/parameter", b'{"component":"/wave","parameter":"rate","value":1e999}',
         b"application/json", 400),
        (b"POST", b"/api/parameter", b'{"component":"/wave","parameter":"rate","value":'
         + b"9" * 4000 + b"}", b"application/json", 400),
        (b"POST", b"/api/parameter", b"{}", b"application/json; charset=none-such", 400),
        (b"POST", b"/api/parameter", b"null", b"\xff", 400),
        (b"POST", b"/api/session", b"\xff", b"\xff", 200),
    ],
)  # fmt: skip
def test_invalid_json_is_rejected_in_one_line(
    scope: ScopeProcess, method: bytes, path: bytes, body: bytes, kind: bytes, expected: int
) -> None:
    headers = [*_good(scope, path, method), b"Content-Type: " + kind,
               b"Content-Length: %d" % len(body)]  # fmt: skip
    assert _is_in_order(scope, _request(*headers, body=body)) == expected


PIECE = st.one_of(
    st.binary(max_size=12),
    st.sampled_from(
        [b"\xff", b"\x00", b"\r", b"\n", b"%", b"%ff", b"%00", b"..", b"/", b"?", b"&", b"=", b"#",
         b"[", b"]", b":", b"\xed\xa0\x80", b"\xc3\xa9", b" ", b"\t", b'"', b"a" * 9000,
         b"127.0.0.1", b"-1"]
    ),
)  # fmt: skip
TEXT = st.lists(PIECE, max_size=5).map(b"".join)
NAMES = st.sampled_from(
    [b"Host", b"Authorization", b"Origin", b"Cookie", b"Content-Length", b"Content-Type",
     b"Transfer-Encoding", b"Content-Encoding", b"Expect", b"Upgrade", b"Connection", b"Accept",
     b"Sec-WebSocket-Key", b"Sec-WebSocket-Version", b"Sec-WebSocket-Protocol",
     b"Sec-WebSocket-Extensions", b"Range", b"If-Modified-Since", b"\xff"]
)  # fmt: skip
PATHS = st.sampled_from(
    [b"/", b"/page/main.js", b"/stream", b"/api/session", b"/api/about", b"/api/graph",
     b"/api/statistics", b"/api/component?name=", b"/api/history", b"/api/parameter",
     b"/api/layouts", b"/api/layouts/", b"/api/recordings/", b"/api/mcap?first="]
)  # fmt: skip
VALUES = TEXT | st.sampled_from(
    [b"websocket", b"Upgrade", b"chunked", b"gzip", b"deflate", b"br", b"100-continue", b"13", b"0",
     b"application/json; charset=utf-7", b"application/json", b"99999999999999999999",
     b"rtcf-scope", b"permessage-deflate; server_max_window_bits=99", b"close",
     b"dGhlIHNhbXBsZSBub25jZQ=="]
)  # fmt: skip
BODIES = TEXT | st.sampled_from(
    [DEEP, b'{"component":1}', b"5\r\nhello\r\n0\r\n\r\n", b"zz\r\n", b"\x81\xfe\xff\xff", b"{}"]
)


@st.composite
def requests(draw: st.DrawFn) -> tuple[bool, list[bytes], bytes]:
    """Draw a request: whether it has the token, the lines of its head, and its body."""
    method = draw(st.sampled_from([b"GET", b"GET", b"POST", b"PUT", b"DELETE", b"HEAD", b"\xff"]))
    version = draw(st.sampled_from([b"HTTP/1.1"] * 6 + [b"HTTP/1.0", b"HTTP/9", b"", b"\xff"]))
    line = b" ".join([method, draw(PATHS) + draw(st.just(b"") | TEXT), version])
    headers = draw(st.lists(st.tuples(NAMES, VALUES), max_size=6))
    host = draw(st.sampled_from([[b"Host: 127.0.0.1"]] * 4 + [[]]))
    lines = [line, *host, *(name + b": " + value for name, value in headers)]
    body = draw(BODIES)
    if draw(st.booleans()):
        lines.append(b"Content-Length: %d" % len(body))
    return draw(st.booleans()), lines, body


def _seeded(most: int) -> Callable[[Any], Any]:
    chosen = hypothesis.settings(
        max_examples=most, suppress_health_check=list(hypothesis.HealthCheck), print_blob=False
    )
    return lambda test: hypothesis.seed(SEED)(chosen(test))


def _try(scope: ScopeProcess, request: tuple[bool, list[bytes], bytes]) -> None:
    known, lines, body = request
    token = [b"Authorization: Bearer " + scope.token.encode()] if known else []
    # An incomplete request gets no answer.
    _is_in_order(scope, _request(*lines, *token, b"Connection: close", body=body), patience_s=0.5)
    assert scope.process.poll() is None


@_seeded(300)
@hypothesis.given(request=requests())
def test_no_request_causes_an_internal_error(
    scope: ScopeProcess, request: tuple[bool, list[bytes], bytes]
) -> None:
    _try(scope, request)


@pytest.mark.long
@_seeded(20_000)
@hypothesis.given(request=requests())
def test_none_of_many_requests_causes_an_internal_error(
    scope: ScopeProcess, request: tuple[bool, list[bytes], bytes]
) -> None:
    _try(scope, request)


def test_invalid_frames_end_only_their_page(scope: ScopeProcess) -> None:
    upgrade = [
        b"GET /stream HTTP/1.1", b"Host: 127.0.0.1", b"Connection: Upgrade", b"Upgrade: websocket",
        b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", b"Sec-WebSocket-Version: 13",
        b"Authorization: Bearer " + scope.token.encode(),
    ]  # fmt: skip
    for frame in (b"\xff" * 20, b"\x81\x7f" + b"\xff" * 8, b"\x81\x05hello",
                  b"\x81\x82abcd\x9e\x9d", b"\x82\xfe\xff\xff",
                  b"\x89\xff" + b"\xff" * 200):  # fmt: skip
        with socket.create_connection(("127.0.0.1", scope.port), timeout=60) as connection:
            connection.sendall(_request(*upgrade) + frame)
            connection.shutdown(socket.SHUT_WR)
            while connection.recv(65536):
                pass
        _is_calm(scope, frame)
    assert scope.ask("/api/about")[0] == 200


IDLE = """\
import socket, sys
idle = [socket.create_connection(("127.0.0.1", int(sys.argv[1]))) for _ in range(int(sys.argv[2]))]
print("connected", flush=True)
sys.stdin.read()
"""


# Requests much and reads nothing, on many connections.
UNREAD = """\
import socket, sys
unread = []
for _ in range(300):
    unread.append(socket.socket())
    unread[-1].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    unread[-1].connect(("127.0.0.1", int(sys.argv[1])))
    get = b"GET /page/three/three.module.js HTTP/1.1\\r\\nHost: 127.0.0.1\\r\\n\\r\\n"
    unread[-1].sendall(get * 12)
print("connected", flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to act as another user")
def test_a_user_who_reads_no_responses_holds_few_connections(scope: ScopeProcess) -> None:
    descriptors = Path(f"/proc/{scope.process.pid}/fd")
    before = len(list(descriptors.iterdir()))
    with subprocess.Popen(
        ["/usr/bin/python3", "-c", UNREAD, str(scope.port)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, user=NOBODY, group=NOBODY,
    ) as other:  # fmt: skip
        assert other.stdout is not None and other.stdout.readline() == "connected\n"
        assert scope.ask("/api/about")[0] == 200
        # At most 16 are served, and 16 closed after the time to log in.
        wait_for(lambda: len(list(descriptors.iterdir())) <= before + 33, "the end of the others")
        other.communicate()
    assert scope.news() == ""


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to act as another user")
@pytest.mark.parametrize("number", [140, 600])
def test_idle_connections_of_another_user_do_not_keep_others_away(
    scope: ScopeProcess, number: int
) -> None:
    with subprocess.Popen(
        ["/usr/bin/python3", "-c", IDLE, str(scope.port), str(number)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, user=NOBODY, group=NOBODY,
    ) as other:  # fmt: skip
        assert other.stdout is not None and other.stdout.readline() == "connected\n"
        assert scope.ask("/api/about", token=scope.token)[0] == 200
        other.communicate()
