"""`rtcfctl check`: is a component safe in real time?"""

import argparse
import linecache
import sys
from pathlib import Path
from typing import Any

import rtcf
from rtcf.checking import check, executor_of
from rtcf.sanitizer import Frame, Violation

from rtcfctl.terminal.output import Output

_EXECUTOR_FRAMES = 5  # of a stack that is not the component's


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    checking = verbs.add_parser(
        "check",
        parents=[common],
        help="run a component under RealtimeSanitizer (without rtcfd; package rtcf-check)",
    )
    checking.add_argument("package", metavar="PKG")
    checking.add_argument("type", metavar="COMPONENT")
    checking.add_argument("--cycles", type=int, default=1000, metavar="N", help="default: 1000")
    checking.add_argument("--param", action="append", default=[], metavar="NAME:=VALUE")
    checking.add_argument(
        "--path",
        type=Path,
        action="append",
        default=[],
        metavar="DIR",
        help="look for packages here first (repeatable)",
    )
    checking.add_argument("--executor", type=Path, metavar="FILE", help="executor to run it in")
    checking.set_defaults(run=run)


def run(_: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Check a component; violations are a refusal."""
    if args.cycles < 1:
        raise ValueError(f"--cycles {args.cycles}: name at least 1")
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
            output.line(f"{name}: output {port} carried NaN or infinity", "yellow")
        for member in found.undeclared:
            print(
                f"{name}: note: a member changes that is not declared ({member}): as an "
                "rtcf::State it would be kept by replace and snapshot",
                file=sys.stderr,
            )
    unsafe = (
        f"{len(found.violations)} calls that are not safe in real time" if found.violations else ""
    )
    if found.ended:
        raise rtcf.RtcfError(f"{name}: {found.ended}{unsafe and f'; and {unsafe}'}")
    if unsafe:
        raise rtcf.RtcfError(f"{name}: {unsafe} in {args.cycles} cycles")
    if output.for_people:
        output.line(f"{name}: clean in {args.cycles} cycles", "green")


def _print(number: int, violation: Violation, output: Output) -> None:
    """Print one violation: the call, the way to it, the line of the source."""
    output.line(f"{number}. {violation.called or violation.kind}", "bold red")
    frames = violation.short_frames
    if violation.of_executor:
        output.line("   in the executor itself, not in the component:")
        frames = violation.frames[:_EXECUTOR_FRAMES]
    elif not frames:
        output.line("   by what update() calls last, which leaves no frame of it")
    shown = False
    for frame in frames:
        place = f"  {frame.file}:{frame.line}" if frame.file else ""
        output.line(f"   {frame.function}{place}")
        source = _source(frame)
        # The innermost one of the component, not of a library's header.
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
