"""`rtcfctl scope`: an oscilloscope in the browser, for one session."""

import argparse
import asyncio
import os
import sys
import webbrowser
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import rtcf

from rtcfctl.terminal.output import Output

_PACKAGE = "rtcfctl scope is in a package of its own: apt install rtcf-scope"


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    scope = verbs.add_parser(
        "scope", parents=[common], help="an oscilloscope in the browser, until Ctrl-C"
    )
    scope.add_argument(
        "files", nargs="*", metavar="FILE", type=Path, help="recordings that the page may open"
    )
    try:
        from rtcf_scope import service
    except ImportError:
        scope.set_defaults(run=_missing)
        return
    service.add_options(scope, 0)
    scope.add_argument("--no-browser", action="store_true", help="print the address only")
    scope.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Serve until Ctrl-C."""
    from rtcf_scope import service

    given = service.options(args, args.files)

    def ready(address: str) -> None:
        where = urlsplit(address)
        print(address, flush=True)
        if hint := _way_through_ssh(where.port or 80):
            print(f"from your machine:  {hint}", file=sys.stderr)
        if not args.no_browser and _has_display():
            webbrowser.open(address)

    asyncio.run(service.serve(given, ready))


def _missing(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    raise rtcf.RtcfError(_PACKAGE)


def _way_through_ssh(port: int) -> str:
    """Return the command that brings the page to the machine that somebody sits at."""
    words = os.environ.get("SSH_CONNECTION", "").split()
    if len(words) != 4:
        return ""
    host = f"[{words[2]}]" if ":" in words[2] else words[2]
    user = os.environ.get("USER", "")
    via = f" -p {words[3]}" if words[3] != "22" else ""
    return f"ssh -N -L {port}:127.0.0.1:{port}{via} {user + '@' if user else ''}{host}"


def _has_display() -> bool:
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
