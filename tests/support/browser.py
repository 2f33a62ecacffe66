"""Debian's Chromium in headless mode, controlled by its DevTools protocol."""

import asyncio
import base64
import contextlib
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import aiohttp
from daemon_process import DEADLINE_S, wait_for
from rtcf.connection import Closing

_POLL_S = 0.05


class Browser(Closing):
    """A browser with its own profile; ends with its `with` block."""

    def __init__(self, folder: Path, *, webgl: bool = False) -> None:
        self._folder = folder / "chromium"
        # Without a graphics card: by software.
        graphics = (
            ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-compositing"]
            if webgl
            else ["--disable-gpu"]
        )
        # Chromium's sandbox does not work where it may not create namespaces, as in containers.
        sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []
        self._process = subprocess.Popen(
            ["chromium", "--headless=new", *sandbox, *graphics, "--disable-dev-shm-usage",
             "--no-first-run", "--disable-background-networking", "--disable-component-update",
             "--disable-extensions", "--remote-debugging-port=0", "--hide-scrollbars",
             f"--user-data-dir={self._folder}", "about:blank"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            start_new_session=True,
        )  # fmt: skip
        self._loop = asyncio.new_event_loop()
        self._session = self._run(_session())

    @property
    def pid(self) -> int:
        """Return the pid of its first process, the parent of the others."""
        return self._process.pid

    def close(self) -> None:
        if self._loop.is_closed():
            return
        self._run(self._session.close())
        self._loop.close()
        self.kill()

    def kill(self) -> None:
        """Kill it, as a power cut does."""
        self._process.kill()
        self._process.wait()

    def page(self, address: str, width: int = 1280, height: int = 800) -> "Page":
        """Open an address."""
        port_file = self._folder / "DevToolsActivePort"
        wait_for(lambda: port_file.exists() and len(port_file.read_text().split()) == 2, "Chromium")
        port, _ = port_file.read_text().split()
        target = self._run(self._new(f"http://127.0.0.1:{port}/json/new?about:blank"))
        socket = self._run(self._session.ws_connect(target["webSocketDebuggerUrl"], max_msg_size=0))
        page = Page(self._loop, socket)
        page.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
            mobile=False,
        )  # fmt: skip
        for domain in ("Runtime", "Log"):
            page.call(f"{domain}.enable")
        page.call("Page.navigate", url=address)
        return page

    async def _new(self, address: str) -> Any:
        async with self._session.put(address) as response:
            return await response.json()

    def _run(self, what: Any) -> Any:
        return self._loop.run_until_complete(asyncio.wait_for(what, DEADLINE_S))


class _NavigatedError(Exception):
    """The page went to another address before it answered."""


class Page:
    """One page of the browser."""

    def __init__(
        self, loop: asyncio.AbstractEventLoop, socket: aiohttp.ClientWebSocketResponse
    ) -> None:
        self._loop = loop
        self._socket = socket
        self._number = 0
        self.errors: list[str] = []  # errors of scripts and failed requests

    def close(self) -> None:
        """Close it: Chromium does not draw a page behind another one."""
        self.call("Page.close")

    def call(self, method: str, **words: Any) -> Any:
        """Call a method of the DevTools protocol; return its result."""
        return self._loop.run_until_complete(
            asyncio.wait_for(self._call(method, words), DEADLINE_S)
        )

    def ask(self, expression: str) -> Any:
        """Return the value of a JavaScript expression, which may be a promise."""
        told = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in told, told["exceptionDetails"]
        return told["result"].get("value")

    def wait(self, expression: str) -> Any:
        """Return the value of an expression once it is true."""
        deadline = time.monotonic() + DEADLINE_S
        asked = f"(() => {{ try {{ return {expression} }} catch {{ }} }})()"
        while True:
            with contextlib.suppress(_NavigatedError):
                if found := self.ask(asked):
                    return found
            assert time.monotonic() < deadline, f"waited for {expression}; the page says: " + str(
                self.ask("document.body.innerText.slice(0, 600)")
            )
            time.sleep(_POLL_S)

    def screenshot(self, file: Path) -> None:
        """Write a screenshot as PNG."""
        file.write_bytes(base64.b64decode(self.call("Page.captureScreenshot")["data"]))

    def trace(self, seconds: float, categories: list[str]) -> list[dict[str, Any]]:
        """Record the browser for some seconds; return events for about:tracing."""
        self.call("Tracing.start", transferMode="ReportEvents",
                  traceConfig={"includedCategories": categories})  # fmt: skip
        time.sleep(seconds)
        self.call("Tracing.end")
        return self._loop.run_until_complete(asyncio.wait_for(self._traced(), DEADLINE_S))

    async def _traced(self) -> list[dict[str, Any]]:
        events: list[dict[str, Any]] = []
        while True:
            told = await self._socket.receive_json()
            if told.get("method") == "Tracing.dataCollected":
                events += told["params"]["value"]
            elif told.get("method") == "Tracing.tracingComplete":
                return events

    async def _call(self, method: str, words: dict[str, Any]) -> Any:
        self._number += 1
        number = self._number
        await self._socket.send_json({"id": number, "method": method, "params": words})
        while True:
            told = await self._socket.receive_json()
            if told.get("method") == "Runtime.exceptionThrown":
                details = told["params"]["exceptionDetails"]
                self.errors.append(
                    details.get("exception", details).get("description", str(details))
                )
            elif (
                told.get("method") == "Log.entryAdded"
                and told["params"]["entry"]["level"] == "error"
            ):
                self.errors.append(str(told["params"]["entry"]["text"]))
            if told.get("id") == number:
                if "navigated" in told.get("error", {}).get("message", ""):
                    raise _NavigatedError
                assert "error" not in told, told["error"]
                return told["result"]


async def _session() -> aiohttp.ClientSession:
    return aiohttp.ClientSession()
