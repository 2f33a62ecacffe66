"""rtcfctl's command line: global options, dispatch to the verbs, exit codes."""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import rtcf

from rtcfctl import (
    check,
    completion,
    component,
    doctor,
    files,
    graph,
    loop,
    parameter,
    replay,
    runner,
    stats,
    status,
    types,
)
from rtcfctl.output import Output

DONE, REFUSED, USAGE, UNREACHABLE = range(4)

_NOUNS = (
    status,
    runner,
    loop,
    replay,
    component,
    graph,
    files,
    parameter,
    types,
    stats,
    check,
    doctor,
)


def main(arguments: Sequence[str] | None = None, build_tree: Path | None = None) -> int:
    """Run one command; return its exit code."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    if words[:1] == [completion.REQUEST]:
        for candidate in completion.candidates(parser(), words[1:]):
            print(candidate)
        return DONE
    args = parser().parse_args(words)
    args.build_tree = build_tree
    output = Output(args.output, args.verbose)
    try:
        with rtcf.Client(args.socket) as client:
            # What a verb returns is its own verdict, e.g. doctor's.
            code = args.run(client, args, output)
            sys.stdout.flush()
            return code or DONE
    except rtcf.DaemonUnreachableError as error:
        return _fail(error, UNREACHABLE)
    except rtcf.RtcfError as error:
        return _fail(error, REFUSED)
    except ValueError as error:
        return _fail(error, USAGE)
    except KeyboardInterrupt:
        return _fail("interrupted; a change that had begun goes on", REFUSED)
    except BrokenPipeError:
        # The reader has seen enough; Python would complain once more at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return DONE


def parser() -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    result = argparse.ArgumentParser(
        prog="rtcfctl",
        description="Controls the real-time loops of rtcfd.",
        epilog="Exit codes: 0 done, 1 refused, 2 usage, 3 rtcfd not reachable.",
    )
    result.add_argument("--version", action="version", version=f"rtcfctl {rtcf.__version__}")
    _global_options(result, defaults=True)
    verbs = result.add_subparsers(metavar="COMMAND", required=True)
    # Global options may also stand behind the verb; there they have no default,
    # which would hide one that was given before it.
    common = argparse.ArgumentParser(add_help=False)
    _global_options(common, defaults=False)
    for noun in _NOUNS:
        noun.register(verbs, common)
    return result


def _global_options(to: argparse.ArgumentParser, defaults: bool) -> None:
    def default(value: object) -> object:
        return value if defaults else argparse.SUPPRESS

    to.add_argument(
        "--socket",
        metavar="PATH",
        default=default(None),
        help="rtcfd's control socket (default: $RTCF_SOCKET, else /run/rtcfd/control.sock)",
    )
    to.add_argument(
        "-r",
        "--runner",
        metavar="NAME",
        default=default(""),
        help="the runner meant (default: rt_runner)",
    )
    to.add_argument(
        "-o",
        "--output",
        choices=("table", "json", "yaml"),
        default=default("table"),
        help="output format (default: table)",
    )
    to.add_argument(
        "-v",
        "--verbose",
        action="store_true",
        default=default(False),
        help="show what long calls are doing (always on a terminal)",
    )


def _fail(error: object, code: int) -> int:
    print(f"rtcfctl: {' '.join(str(error).split())}", file=sys.stderr)
    return code
