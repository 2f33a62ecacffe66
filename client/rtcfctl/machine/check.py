"""`rtcfctl check`: checks whether a component is real-time safe."""

import argparse
import linecache
import sys
from pathlib import Path
from typing import Any

import rtcf
from rtcf.checking import check, executor_of
from rtcf.sanitizer import Frame, Violation

from rtcfctl.terminal.output import Output

_EXECUTOR_FRAMES = 5  # printed frames of a stack without the component


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    checking = verbs.add_parser(
        "check",
        parents=[common],
        help="run a component under RealtimeSanitizer (without rtcfd; package rtcf-check)",
    )
    checking.add_argument("package", metavar="PKG")
    checking.add_argument("type", metavar="COMPONENT")
    checking.add_argument(
        "--cycles", type=int, default=1000, metavar="N", help="run N updates (default: 1000)"
    )
    checking.add_argument("--param", action="append", default=[], metavar="NAME:=VALUE")
    checking.add_argument(
        "--path",
        type=Path,
        action="append",
        default=[],
        metavar="DIR",
        help="search packages in this folder first (repeatable)",
    )
    checking.add_argument("--executor", type=Path, metavar="FILE", help="use this executor")
    checking.set_defaults(run=run)


def run(_: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Check a component.  Raises RtcfError if there are violations."""
    if args.cycles < 1:
        raise ValueError(f"--cycles {args.cycles}: at least 1")
    for parameter in args.param:
        rtcf.parse_parameter(parameter)
    executor = args.executor or executor_of(args.build_tree)
    name = f"{args.package}/{args.type}"
    found = check(
        executor, args.package, args.type, args.cycles, args.param, args.path, args.build_tree
    )
    if not output.for_people:
        output.data(
            {
                "package": args.package,
                "type": args.type,
                "library": found.library,
                "cycles": args.cycles,
                "violations": [_plain(each) for each in found.violations],
                "not_finite": found.not_finite,
                "undeclared": found.undeclared,
                "ended": found.ended,
                "log": found.log,
            }
        )
    else:
        for number, each in enumerate(found.violations, 1):
            _print(number, each, output)
        for line in found.log:
            print(line, file=sys.stderr)
        for port in found.not_finite:
            output.line(f"{name}: output {port} had NaN or infinity", "yellow")
        for member in found.undeclared:
            print(
                f"{name}: note: a member changes but is not declared as state ({member}): replace "
                "and snapshot keep only rtcf::State",
                file=sys.stderr,
            )
    unsafe = (
        f"{len(found.violations)} calls that are not real-time safe" if found.violations else ""
    )
    if found.ended:
        raise rtcf.RtcfError(f"{name}: {found.ended}{unsafe and f'; and {unsafe}'}")
    if unsafe:
        raise rtcf.RtcfError(f"{name}: {unsafe} in {args.cycles} cycles")
    if output.for_people:
        output.line(f"{name}: clean in {args.cycles} cycles", "green")


def _print(number: int, violation: Violation, output: Output) -> None:
    """Print one violation: the call, the stack, and the source line of the component."""
    output.line(f"{number}. {violation.called or violation.kind}", "bold red")
    frames = violation.short_frames
    if violation.of_executor:
        output.line("   in the executor itself, not in the component:")
        frames = violation.frames[:_EXECUTOR_FRAMES]
    elif not frames:
        output.line("   in a tail call of update(), which leaves no frame of the component")
    shown = False
    for frame in frames:
        place = f"  {frame.file}:{frame.line}" if frame.file else ""
        output.line(f"   {frame.function}{place}")
        source = _source(frame)
        # Print the source line of the component's innermost frame, not of a library header.
        if source and not shown and not frame.of_library:
            output.line(f"   > {source}", "yellow")
            shown = True


def _source(frame: Frame) -> str:
    return linecache.getline(frame.file, frame.line).strip() if frame.line else ""


def _plain(violation: Violation) -> dict[str, Any]:
    return {
        "kind": violation.kind,
        "called": violation.called,
        "stack": [
            {"function": frame.function, "file": frame.file, "line": frame.line}
            for frame in violation.component_frames or violation.frames
        ],
    }
