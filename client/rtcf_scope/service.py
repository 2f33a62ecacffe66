"""The scope's server, for rtcf-scope.service and for one session of `rtcfctl scope`."""

import argparse
import asyncio
import os
import secrets
import signal
import socket
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rtcf
from aiohttp import web
from rtcf_shared.errors import RtcfError

from rtcf_scope.authentication import LOOPBACK, Authentication
from rtcf_scope.connection import logger
from rtcf_scope.layouts import Layouts
from rtcf_scope.recordings import Recordings
from rtcf_scope.site import RIGHTS, Site

PORT = 8642
MOST_CONNECTIONS = 128
_END_S = 1.0  # for requests in progress when the server ends
_LEAST_TOKEN = 16  # characters


@dataclass(frozen=True)
class Options:
    """The options of a server."""

    socket: str | None
    address: str
    port: int  # 0 = any free port
    names: tuple[str, ...]  # accepted host names, in addition to those of loopback
    right: str  # one of RIGHTS
    token: str
    token_file: Path | None  # the file of the token; None if the token is new
    layouts: Path  # folder
    files: tuple[Path, ...]  # recordings
    recordings: Path | None  # folder


def add_options(parser: argparse.ArgumentParser, port: int) -> None:
    """Add the options of service and session; `port` is the default port (0: any free port)."""
    parser.add_argument(
        "--address", default="127.0.0.1", metavar="ADDRESS",
        help="listen on this address (default: 127.0.0.1, this machine only)",
    )  # fmt: skip
    parser.add_argument(
        "--port",
        type=int,
        default=port,
        metavar="N",
        help=f"listen on this port (default: {port or 'any free port'})",
    )
    parser.add_argument(
        "--name", dest="names", action="append", default=[], metavar="HOST",
        help="accept requests for this name or address of the machine, besides loopback",
    )  # fmt: skip
    parser.add_argument(
        "--right", choices=RIGHTS, default=RIGHTS[0],
        help="right of the pages (default: observe); with tune, pages can set parameters",
    )  # fmt: skip
    parser.add_argument(
        "--layouts", type=Path, metavar="FOLDER", help="save layouts in this folder"
    )
    parser.add_argument(
        "--recordings", type=Path, metavar="FOLDER", help="let pages open *.mcap in this folder"
    )
    parser.add_argument(
        "--token-file", type=Path, metavar="FILE",
        help="read the token from this file, or create it (default: a new token each start)",
    )  # fmt: skip


def options(args: argparse.Namespace, files: Sequence[Path] = ()) -> Options:
    """Return the options of a command line; `files` are its recordings.

    Raises ValueError.
    """
    if not 0 <= args.port < 65536:
        raise ValueError(f"--port {args.port}: must be from 0 to 65535")
    for file in files:
        if not file.is_file():
            raise ValueError(f"{file}: no such file")
    state = os.environ.get("STATE_DIRECTORY") or os.path.join(
        os.environ.get("XDG_STATE_HOME") or os.path.expanduser("~/.local/state"), "rtcf-scope"
    )
    names = tuple(args.names)
    if args.address not in (*LOOPBACK, "0.0.0.0", "::"):
        names += (args.address,)
    return Options(
        args.socket, args.address, args.port, names, args.right, _token(args.token_file),
        args.token_file, args.layouts or Path(state) / "layouts", tuple(files), args.recordings,
    )  # fmt: skip


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
    recordings = Recordings(given.files, given.recordings)
    with rtcf.Client(given.socket) as client:
        site = Site(client, authentication, given.right, Layouts(given.layouts), recordings)
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
        return 1
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


def _token(file: Path | None) -> str:
    """Return the token of a file, which is created if it does not exist; raises ValueError."""
    if file is None:
        return secrets.token_urlsafe(24)
    try:
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o640)
    except FileExistsError:
        pass
    except OSError as error:
        raise ValueError(f"{file}: {error.strerror}") from None
    else:
        with open(descriptor, "w") as made:
            made.write(secrets.token_urlsafe(24) + "\n")
    try:
        token = file.read_text().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{file}: {error}") from None
    if len(token) < _LEAST_TOKEN or not all(c.isalnum() or c in "-_" for c in token):
        raise ValueError(f"{file}: a token needs at least {_LEAST_TOKEN} letters and digits")
    return token
