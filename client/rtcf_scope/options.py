"""The options of the scope's server.

`rtcfctl --help` and completion import this module, so it imports neither aiohttp nor NumPy.
"""

import argparse
import os
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

LOOPBACK = ("127.0.0.1", "localhost", "::1")
RIGHTS = ("observe", "tune", "operate")
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
    robot: Path | None  # URDF


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
        "--robot", type=Path, metavar="FILE",
        help="show the robot of this URDF (default: the one that a component's parameter names)",
    )  # fmt: skip
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
    if args.robot is not None and not args.robot.is_file():
        raise ValueError(f"--robot {args.robot}: no such file")
    state = os.environ.get("STATE_DIRECTORY") or os.path.join(
        os.environ.get("XDG_STATE_HOME") or os.path.expanduser("~/.local/state"), "rtcf-scope"
    )
    names = tuple(args.names)
    if args.address not in (*LOOPBACK, "0.0.0.0", "::"):
        names += (args.address,)
    return Options(
        args.socket, args.address, args.port, names, args.right, _token(args.token_file),
        args.token_file, args.layouts or Path(state) / "layouts", tuple(files), args.recordings,
        args.robot.absolute() if args.robot is not None else None,
    )  # fmt: skip


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
