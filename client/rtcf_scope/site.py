"""The server's routes: the files of the page, its requests in JSON, and its WebSocket."""

import asyncio
import io
import json
import math
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import rtcf
from aiohttp import web
from rtcf_shared.errors import RtcfError
from rtcf_shared.mcap_writer import McapWriter
from rtcf_shared.printable import printable
from rtcf_shared.recorder import Recorder

from rtcf_scope import catalog
from rtcf_scope.authentication import Authentication
from rtcf_scope.hub import Hub
from rtcf_scope.layouts import MOST_BYTES, LayoutError, Layouts
from rtcf_scope.recordings import Recordings
from rtcf_scope.robot import Robots
from rtcf_scope.status_feed import StatusFeed
from rtcf_scope.tab import PROTOCOL, Tab

MOST_TABS = 32
_LONGEST = 500  # characters of an error message
_PAGE = Path(__file__).with_name("page")
_THREE = Path("/usr/share/javascript/three/three.module.js")  # of libjs-three
_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css",
          ".svg": "image/svg+xml"}  # fmt: skip
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Site:
    """One server's pages, hubs and tabs; lives in one event loop."""

    def __init__(
        self,
        client: rtcf.Client,
        authentication: Authentication,
        right: str,
        layouts: Layouts,
        recordings: Recordings,
        robots: Robots,
    ) -> None:
        self._client = client
        self._right = right
        self._layouts = layouts
        self._recordings = recordings
        self._robots = robots
        self._hubs: dict[str, Hub] = {}
        self._feeds: dict[str, StatusFeed] = {}
        self._tabs: set[web.WebSocketResponse | Tab] = set()
        self.app = web.Application(
            middlewares=[authentication.middleware()], client_max_size=MOST_BYTES * 2
        )
        # Read once, by URL path: no path of a request becomes a path of the file system.
        self._files = {
            f"/page/{file.relative_to(_PAGE)}": (file.read_bytes(), _TYPES[file.suffix])
            for file in _PAGE.rglob("*")
            if file.suffix in _TYPES
        }
        if _THREE.is_file():
            self._files["/page/three/three.module.js"] = (_THREE.read_bytes(), _TYPES[".js"])
        route = self.app.router
        route.add_get("/", self._file)
        route.add_get("/page/{name:.*}", self._file)
        route.add_post("/api/session", authentication.enter)
        route.add_get("/api/about", self._json(self._about))
        route.add_get("/api/graph", self._json(self._graph))
        route.add_get("/api/statistics", self._json(self._statistics))
        route.add_get("/api/component", self._json(self._component))
        route.add_get("/api/history", self._json(self._history))
        route.add_post("/api/parameter", self._json(self._set))
        route.add_get("/api/layouts", self._json(self._list_layouts))
        route.add_get("/api/layouts/{name}", self._json(self._read_layout))
        route.add_put("/api/layouts/{name}", self._json(self._write_layout))
        route.add_delete("/api/layouts/{name}", self._json(self._remove_layout))
        route.add_get("/api/incidents", self._json(self._list_incidents))
        route.add_get("/api/recordings", self._json(self._list_recordings))
        route.add_get("/api/recordings/{name}", self._json(self._describe_recording))
        route.add_get("/api/recordings/{name}/columns", self._recorded)
        route.add_get("/api/robot", self._json(self._robot))
        route.add_get("/api/robot/mesh", self._mesh)
        route.add_get("/api/mcap", self._mcap)
        route.add_get("/stream", self._stream)

    def close(self) -> None:
        """Close all streams."""
        for hub in self._hubs.values():
            hub.close()
        for feed in self._feeds.values():
            feed.close()

    async def _file(self, request: web.Request) -> web.Response:
        path = "/page/index.html" if request.path == "/" else request.path
        if path not in self._files:
            raise web.HTTPNotFound(text=f"not found: {printable(path[:_LONGEST])}\n")
        data, kind = self._files[path]
        return web.Response(body=data, content_type=kind, charset="utf-8")

    def _json(self, answer: Callable[[web.Request], Awaitable[Any]]) -> Handler:
        """Return a handler that answers with the result of `answer` or an error, as JSON."""

        async def handle(request: web.Request) -> web.StreamResponse:
            try:
                return web.json_response(await answer(request))
            except (RtcfError, LayoutError, ValueError) as error:
                return error_response(error)
            except RecursionError:
                return error_response("the JSON is nested too deeply")
            except LookupError as error:  # unknown encoding in Content-Type
                return error_response(error)

        return handle

    async def _call(self, what: Callable[..., Any], *words: Any) -> Any:
        return await asyncio.to_thread(what, *words)

    async def _about(self, request: web.Request) -> Any:
        found = await self._call(catalog.runners, self._client)
        return {"version": rtcf.__version__, "right": self._right, "runners": found,
                "socket": self._client.socket}  # fmt: skip

    async def _graph(self, request: web.Request) -> Any:
        return await self._call(catalog.graph, self._client, runner_of(request))

    async def _statistics(self, request: web.Request) -> Any:
        return await self._call(catalog.statistics, self._client, runner_of(request))

    async def _history(self, request: web.Request) -> Any:
        return await self._call(catalog.history, self._client, runner_of(request), 50)

    async def _component(self, request: web.Request) -> Any:
        name = request.query.get("name", "")
        info = await self._call(self._client.get_component, name, runner_of(request))
        return catalog.component(info)

    async def _set(self, request: web.Request) -> Any:
        if self._right == "observe":
            raise ValueError("the scope is read-only: start it with --right tune to set parameters")
        change = await request.json()
        try:
            component, name, value = change["component"], change["parameter"], change["value"]
        except (KeyError, TypeError):
            raise ValueError("a change needs component, parameter and value") from None

        def apply() -> Any:
            runner = runner_of(request)
            info = self._client.get_component(str(component), runner)
            found = next((each for each in info.parameters if each.name == name), None)
            if found is None:
                raise ValueError(f"{component} has no parameter {name}")
            setting = catalog.setting(found, value)
            result = self._client.set_parameters(info.full_name, [setting], runner)
            return {"notes": list(result.notes)}

        return await self._call(apply)

    async def _list_layouts(self, request: web.Request) -> Any:
        return self._layouts.names()

    async def _read_layout(self, request: web.Request) -> Any:
        return self._layouts.read(request.match_info["name"])

    async def _write_layout(self, request: web.Request) -> Any:
        await self._call(self._layouts.write, request.match_info["name"], await request.text())

    async def _remove_layout(self, request: web.Request) -> Any:
        self._layouts.remove(request.match_info["name"])

    async def _list_incidents(self, request: web.Request) -> Any:
        return await self._call(self._recordings.incidents)

    async def _list_recordings(self, request: web.Request) -> Any:
        return await self._call(self._recordings.names)

    async def _describe_recording(self, request: web.Request) -> Any:
        return await self._call(self._recordings.describe, request.match_info["name"])

    async def _recorded(self, request: web.Request) -> web.StreamResponse:
        traces: list[str] = request.query.getall("trace", [])
        try:
            begin, end = (
                float(request.query.get(name, value))
                for name, value in (("begin", -math.inf), ("end", math.inf))
            )
        except ValueError:
            return error_response("begin and end must be numbers, in seconds")
        name = request.match_info["name"]
        try:
            data = await self._call(self._recordings.columns, name, traces, begin, end)
        except RtcfError as error:
            return error_response(error)
        return web.Response(body=data, content_type="application/octet-stream")

    async def _robot(self, request: web.Request) -> Any:
        return await self._call(self._robots.describe, self._client, runner_of(request))

    async def _mesh(self, request: web.Request) -> web.StreamResponse:
        try:
            data = await self._call(self._robots.mesh, request.query.get("name", ""))
        except RtcfError as error:
            return error_response(error)
        return web.Response(body=data, content_type="model/stl")

    async def _mcap(self, request: web.Request) -> web.StreamResponse:
        """Answer with a recording of the requested cycles still in memory, with all columns."""
        runner = runner_of(request) or "rt_runner"
        try:
            first, last = (float(request.query.get(each, "nan")) for each in ("first", "last"))
        except ValueError:
            return error_response("first and last must be cycle numbers")
        hub = self._hubs.get(runner)
        batches = [] if hub is None else [
            chunk.batch for chunk in hub.history
            if not (chunk.cycles[-1] < first or chunk.cycles[0] > last)
        ]  # fmt: skip
        if not batches:
            return error_response("these cycles are no longer in memory")

        def write() -> bytes:
            file = io.BytesIO()
            writer = McapWriter(file)
            recorder = Recorder(writer, runner)
            for batch in batches:
                recorder.add(batch)
            recorder.flush()
            writer.close()
            return file.getvalue()

        name = quote(runner, errors="replace")
        return web.Response(
            body=await self._call(write),
            content_type="application/octet-stream",
            headers={"Content-Disposition": f'attachment; filename="{name}.mcap"'},
        )

    async def _stream(self, request: web.Request) -> web.StreamResponse:
        if len(self._tabs) >= MOST_TABS:
            return error_response(f"{MOST_TABS} pages are already open: close some", 503)
        if not web.WebSocketResponse(protocols=(PROTOCOL,)).can_prepare(request):
            return error_response("/stream requires a WebSocket")
        runner = runner_of(request) or "rt_runner"
        hub = self._hubs.setdefault(runner, Hub(self._client, runner))
        feed = self._feeds.setdefault(runner, StatusFeed(self._client, runner))
        tab = Tab(hub)
        self._tabs.add(tab)
        feed.join(tab)
        try:
            return await tab.serve(request)
        finally:
            feed.leave(tab)
            self._tabs.discard(tab)
            if hub.is_empty:  # names of nonexistent runners must not accumulate
                self._hubs.pop(runner, None)
            if feed.is_empty:
                self._feeds.pop(runner, None)


def runner_of(request: web.Request) -> str:
    """Return the runner of a request; empty selects rt_runner."""
    return request.query.get("runner", "")


def error_response(error: object, status: int = 400) -> web.Response:
    """Return a JSON response with an error message of one line."""
    text = json.dumps({"refused": " ".join(str(error).split())[:_LONGEST]})
    return web.Response(text=text, content_type="application/json", status=status)
