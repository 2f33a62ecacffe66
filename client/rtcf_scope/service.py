"""The scope's server, for rtcf-scope.service and for one session of `rtcfctl scope`."""

import argparse
import asyncio
import os
import signal
import socket
import sys
from collections.abc import Callable, Sequence
from typing import Any

import rtcf
from aiohttp import web
from rtcf_shared.errors import RtcfError

from rtcf_scope.authentication import Authentication
from rtcf_scope.connection import logger
from rtcf_scope.layouts import Layouts
from rtcf_scope.options import Options, add_options, options
from rtcf_scope.recordings import Recordings
from rtcf_scope.robot import Robots
from rtcf_scope.site import Site

FAILED, USAGE = 1, 2  # exit statuses
PORT = 8642
MOST_CONNECTIONS = 128
_END_S = 1.0  # for requests in progress when the server ends


async def serve(given: Options, ready: Callable[[str, Authentication], None]) -> None:
    """Serve until SIGINT or SIGTERM.

    When the server listens, call `ready` with its address and its authentication.  Raises RtcfError
    if it cannot listen on the address.
    """
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    loop.set_exception_handler(_log)
    authentication = Authentication(given.token, given.names, MOST_CONNECTIONS, given.token_file)
    with rtcf.Client(given.socket) as client:
        recordings = Recordings(given.files, given.recordings, client)
        layouts, robots = Layouts(given.layouts), Robots(given.robot)
        site = Site(client, authentication, given.right, layouts, recordings, robots)
        running = web.AppRunner(site.app)
        await running.setup()
        assert running.server is not None
        try:
            try:
                server = await loop.create_server(
                    authentication.open(running.server), given.address, given.port
                )
            except OSError as error:
                raise RtcfError(
                    f"cannot listen on {given.address} port {given.port}: {error.strerror}: "
                    "choose another --port"
                ) from None
            try:
                port = server.sockets[0].getsockname()[1]
                ready(f"http://{_called(given)}:{port}/", authentication)
                await ended.wait()
            finally:
                # Without wait_closed(): since Python 3.12, it waits for the pages' connections.
                server.close()
        finally:
            site.close()
            recordings.close()
            await running.server.shutdown(_END_S)
            await running.cleanup()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the service; return its exit status."""
    parser = argparse.ArgumentParser(
        prog="rtcf-scope", description="An oscilloscope in the browser for the loops of rtcfd."
    )
    parser.add_argument("--socket", metavar="PATH", help="rtcfd's control socket")
    add_options(parser, PORT)
    args = parser.parse_args(arguments)
    try:
        asyncio.run(serve(options(args), _tell_service_manager))
    except (RtcfError, ValueError) as error:
        print(f"rtcf-scope: {error}", file=sys.stderr)
        return USAGE if isinstance(error, ValueError) else FAILED
    return 0


def _log(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Log an error of the event loop that no task handles, as one line."""
    logger().error("%s: %r", context.get("message"), context.get("exception"))


def _tell_service_manager(address: str, _: Authentication) -> None:
    # Without the token: more users can read the journal than the token's file.
    print(f"serving {address}", flush=True)
    path = os.environ.get("NOTIFY_SOCKET")
    if path:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as to:
            to.connect(f"\0{path[1:]}" if path.startswith("@") else path)
            to.send(b"READY=1")


def _called(given: Options) -> str:
    host = given.names[0] if given.names else given.address
    # Not localhost: it can resolve to an address on which another server listens.
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    return f"[{host}]" if ":" in host else host
