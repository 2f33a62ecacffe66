"""rtcfctl's command line: global options, dispatch to the verbs, exit codes."""

import argparse
import importlib
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rtcf
from rtcf.connection import DEFAULT_SOCKET

from rtcfctl.terminal.interruption import interrupt, interrupted_by_termination
from rtcfctl.terminal.safe_streams import safe_streams

if TYPE_CHECKING:
    from rtcfctl.terminal.output import Output

DONE, REFUSED, USAGE, UNREACHABLE = range(4)

# The module of each verb.  Only the module of the called verb is imported: imports take time.
_MODULES = {
    "status": "loop.status",
    "runner": "loop.runner",
    "start": "loop.running",
    "stop": "loop.running",
    "step": "loop.running",
    "run": "graph.run",
    "replay": "loop.replay",
    "load": "graph.component",
    "unload": "graph.component",
    "replace": "graph.component",
    "release": "graph.component",
    "reset": "graph.parameter",
    "snapshot": "graph.snapshot",
    "restore": "graph.snapshot",
    "list": "graph.component",
    "info": "graph.component",
    "graph": "graph.drawing",
    "order": "graph.connections",
    "connections": "graph.connections",
    "break": "graph.connections",
    "unbreak": "graph.connections",
    "apply": "graph.files",
    "save": "graph.files",
    "set": "graph.parameter",
    "history": "graph.parameter",
    "undo": "graph.parameter",
    "types": "graph.types",
    "stats": "loop.stats",
    "top": "loop.top",
    "events": "signals.events",
    "logs": "signals.logs",
    "echo": "signals.echo",
    "get": "signals.get",
    "hz": "signals.hz",
    "plot": "signals.plot",
    "wait": "signals.wait",
    "write": "signals.write",
    "record": "signals.record",
    "convert": "signals.convert",
    "trace": "signals.trace",
    "scope": "signals.scope",
    "incident": "signals.incident",
    "identify": "control.identify",
    "tune": "control.tune",
    "check": "machine.check",
    "doctor": "machine.doctor",
    "metrics": "machine.metrics",
    "new": "machine.new",
}
_COMPLETION = "__complete"
_HELP = "help"  # help VERB = VERB --help
# Global options that take the next word as their value.
_WITH_VALUE = ("-H", "--host", "--socket", "-r", "--runner", "-o", "--output")
_WITH_EQUALS = ("--host=", "--socket=", "--runner=", "--output=")
# Verbs that work only on the local machine.
_OF_THIS_MACHINE = ("check", "doctor", "run")


def main(arguments: Sequence[str] | None = None, build_tree: Path | None = None) -> int:
    """Run one command; return its exit code."""
    with safe_streams():
        return _main(sys.argv[1:] if arguments is None else list(arguments), build_tree)


def _main(words: list[str], build_tree: Path | None) -> int:
    if words[:1] == [_COMPLETION]:
        from rtcfctl import completion

        for candidate in completion.candidates(parser(), words[1:]):
            print(candidate)
        return DONE
    if words[:1] == [_HELP]:
        words = [*words[1:], "--help"]
    verb = verb_of(words)
    if not verb and (wrong := _first_word(words)):
        from rtcf_shared.naming import suggestion

        hint = suggestion(wrong, [*_MODULES, _HELP])
        return _fail(f'no command "{wrong}"{hint}; `rtcfctl --help` lists all', USAGE)
    args = parser(verb).parse_args(words)
    args.build_tree = build_tree
    args.verb = verb
    from rtcfctl.terminal.output import Output

    output = Output(args.output, args.verbose)
    # The program rtcfctl sets SIG_DFL, which holds before and after this call.
    minds = signal.getsignal(signal.SIGINT) is signal.SIG_DFL
    try:
        if minds:
            signal.signal(signal.SIGINT, interrupt)
        try:
            return _run(args, output)
        finally:
            if minds:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
                signal.signal(signal.SIGINT, signal.SIG_DFL)
    except KeyboardInterrupt:
        code = _fail("interrupted; a change that had started continues", REFUSED)
        if minds:
            # Threads of gRPC that are in a call may crash while Python ends.
            with suppress(OSError, ValueError):
                sys.stdout.flush()
            os._exit(code)
        return code


def _run(args: argparse.Namespace, output: "Output") -> int:
    """Run the parsed command; return the exit code."""
    try:
        with ExitStack() as ways:
            if args.host is not None:
                ways.enter_context(interrupted_by_termination())
                ways.enter_context(_another_machine(args))
            client = ways.enter_context(rtcf.Client(args.socket))
            # A verb may return an exit code of its own, as doctor does.
            code = args.run(client, args, output)
            sys.stdout.flush()
            return code or DONE
    except rtcf.DaemonUnreachableError as error:
        return _fail(error, UNREACHABLE)
    except rtcf.RtcfError as error:
        for line in error.lines:
            _fail(line, REFUSED)
        return REFUSED
    except ValueError as error:
        return _fail(error, USAGE)
    except BrokenPipeError:
        _drop_output()  # the reader has closed the pipe
    except OSError as error:
        # If flushing standard output fails, the error is there, e.g. a full disk.
        try:
            sys.stdout.flush()
        except OSError:
            _drop_output()
            return _fail(f"standard output: {error.strerror}", REFUSED)
        what = f"{error.filename}: " if error.filename is not None else ""
        return _fail(f"{what}{error.strerror or error}", REFUSED)
    return DONE


@contextmanager
def _another_machine(args: argparse.Namespace) -> Iterator[None]:
    """Forward the control socket of another machine, and use it as args.socket."""
    from rtcfctl.machine import remote

    if args.verb in _OF_THIS_MACHINE:
        raise ValueError(
            f"{args.verb} works on the local machine: use ssh {args.host} rtcfctl {args.verb}"
        )
    there = args.socket or DEFAULT_SOCKET
    with remote.control_socket_of(args.host, args.socket) as here:
        args.socket = here
        try:
            yield
        except rtcf.DaemonUnreachableError as error:
            raise rtcf.DaemonUnreachableError(
                str(error).replace(here, f"{there} of {args.host}")
            ) from None


def _drop_output() -> None:
    """Discard further standard output; else Python reports the error again at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Parser(argparse.ArgumentParser):
    """A parser without abbreviations of options: a new option would change their meaning."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(allow_abbrev=False, **arguments)


def parser(verb: str = "") -> argparse.ArgumentParser:
    """Return the parser of all commands, or only of the given verb."""
    result = _Parser(
        prog="rtcfctl",
        description="Controls the real-time loops of rtcfd.",
        epilog="Exit codes: 0 success, 1 error, 2 usage error, 3 rtcfd cannot be reached.",
    )
    result.add_argument("--version", action="version", version=f"rtcfctl {rtcf.__version__}")
    _global_options(result, defaults=True)
    verbs = result.add_subparsers(metavar="COMMAND", required=True)
    if not verb:
        helping = verbs.add_parser(_HELP, help="show the options of a command")
        helping.add_argument("command", metavar="COMMAND", nargs="?", choices=_MODULES)
    # Global options may also follow the verb.  There they have no default, which would
    # override a value given before the verb.
    for module in [_MODULES[verb]] if verb else dict.fromkeys(_MODULES.values()):
        # A new parser for each module: verbs that use -o for a file remove it from the parser.
        common = _Parser(add_help=False)
        _global_options(common, defaults=False)
        importlib.import_module(f"rtcfctl.{module}").register(verbs, common)
    return result


def verb_of(words: Sequence[str]) -> str:
    """Return the verb of a command line, or "" if only the whole parser can find it."""
    word = _first_word(words)
    return word if word in _MODULES else ""


def _first_word(words: Sequence[str]) -> str:
    """Return the first word after the global options; "" for another option or for none."""
    left = iter(words)
    for word in left:
        if word in _WITH_VALUE:
            next(left, None)
        elif word not in ("-v", "--verbose") and not word.startswith(_WITH_EQUALS):
            return "" if word.startswith("-") else word
    return ""


def _global_options(to: argparse.ArgumentParser, defaults: bool) -> None:
    def default(value: object) -> object:
        return value if defaults else argparse.SUPPRESS

    to.add_argument(
        "-H",
        "--host",
        metavar="[USER@]HOST",
        default=default(None),
        help="use rtcfd of another machine, through ssh",
    )
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
        help="select the runner (default: rt_runner)",
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
        help="print the progress of long calls (always on a terminal, and after 10 s)",
    )


def _fail(error: object, code: int) -> int:
    print(f"rtcfctl: {' '.join(str(error).split())}", file=sys.stderr)
    return code
