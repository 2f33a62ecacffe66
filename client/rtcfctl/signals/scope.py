"""`rtcfctl scope`: serves an oscilloscope for the browser until Ctrl-C."""

import argparse
import asyncio
import contextlib
import os
import shutil
import sys
import threading
import webbrowser
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import rtcf

from rtcfctl.terminal.output import Output

_PACKAGE = "rtcfctl scope requires a package: sudo apt install rtcf-scope"


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    scope = verbs.add_parser(
        "scope", parents=[common], help="serve an oscilloscope for the browser until Ctrl-C"
    )
    scope.add_argument(
        "files", nargs="*", metavar="FILE", type=Path, help="recordings that the page can open"
    )
    try:
        from rtcf_scope import options
    except ImportError:
        scope.set_defaults(run=_missing)
        return
    options.add_options(scope, 0)
    scope.add_argument("--no-browser", action="store_true", help="only print the address")
    scope.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Serve until Ctrl-C."""
    try:
        from rtcf_scope import options, service
        from rtcf_scope.authentication import Authentication
        from rtcf_scope.redirect import Redirect
    except ImportError:
        raise rtcf.RtcfError(_PACKAGE) from None

    given = options.options(args, args.files)
    with contextlib.ExitStack() as at_the_end:

        def ready(address: str, authentication: Authentication) -> None:
            print(f"{address}?token={given.token}", flush=True)
            if hint := _way_through_ssh(urlsplit(address).port or 80):
                print(f"from your machine:  {hint}", file=sys.stderr)
            if args.no_browser or not _has_display():
                return
            try:
                redirect = Redirect(
                    f"{address}?token={authentication.ticket(lambda: redirect.remove())}"
                )
            except OSError as error:
                print(f"cannot open a browser: {error}; open the address above", file=sys.stderr)
                return
            at_the_end.callback(redirect.remove)
            # By a thread, because some browsers block until they are closed.
            threading.Thread(target=_open, args=(redirect.file,), daemon=True).start()

        asyncio.run(service.serve(given, ready))


def _open(file: Path) -> None:
    if _is_snap() or not webbrowser.open(file.as_uri()):
        print("cannot open a browser; open the address above", file=sys.stderr)


def _is_snap() -> bool:
    """Return whether the browser is a snap, which cannot read files of the runtime folder."""
    try:
        name = webbrowser.get().name
    except webbrowser.Error:
        return False
    path = os.path.realpath(shutil.which(name) or "")
    return path == "/usr/bin/snap" or path.startswith("/snap/")


def _missing(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    raise rtcf.RtcfError(_PACKAGE)


def _way_through_ssh(port: int) -> str:
    """Return the ssh command that forwards the port to the user's machine; empty without ssh."""
    words = os.environ.get("SSH_CONNECTION", "").split()
    if len(words) != 4:
        return ""
    host = f"[{words[2]}]" if ":" in words[2] else words[2]
    user = os.environ.get("USER", "")
    via = f" -p {words[3]}" if words[3] != "22" else ""
    return f"ssh -N -L {port}:127.0.0.1:{port}{via} {user + '@' if user else ''}{host}"


def _has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
