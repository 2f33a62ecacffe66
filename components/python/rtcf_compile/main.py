"""`rtcf-compile`: compile Python sources to a component library."""

import argparse
import gc
import importlib.util
import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rtcf_compile.source.report import Report

DONE, REFUSED, USAGE, DIFFERENT = range(4)
INTERRUPTED = 130

_AMOUNT = re.compile(r"0*[1-9]\d{0,11}|(?=[\d.]*[1-9])\d{1,9}(\.\d{1,9})?s")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(
        prog="rtcf-compile",
        description="Compile components in Python to a library, which runs without Python.",
        epilog="Exit codes: 0 success, 1 error, 2 usage error, 3 results differ from the "
        "interpreter's, or update raises in every cycle, 130 Ctrl-C.",
    )
    parser.add_argument("sources", metavar="SOURCE", nargs="+", type=Path)
    parser.add_argument("-o", dest="output", metavar="LIB", type=Path, help="write this library")
    parser.add_argument(
        "--verify",
        metavar="CYCLES|SECONDSs",
        nargs="?",
        const="10000",
        help="compare the machine code with the interpreter for this number of cycles, or for this "
        "processor time: 1s (default: 10000)",
    )
    parser.add_argument("--seed", metavar="N", type=int, default=1, help="seed of the inputs")
    parser.add_argument(
        "--depfile",
        metavar="FILE",
        type=Path,
        help="write the files that the library depends on to this file, as a rule for make",
    )
    args = parser.parse_args(arguments)
    if args.output is None and args.verify is None:
        parser.error("give -o LIB, --verify or both")
    if args.verify is not None and not _AMOUNT.fullmatch(args.verify):
        parser.error(f"--verify {args.verify}: give cycles (10000) or seconds (1s)")
    try:
        return _run(args)
    except KeyboardInterrupt:
        return INTERRUPTED


def _run(args: argparse.Namespace) -> int:
    from rtcf_compile.source import dependencies
    from rtcf_compile.source.report import Report

    begin_ns = time.time_ns()
    report = Report()
    classes = _classes(args.sources, report)
    if args.depfile is not None:
        args.depfile.write_text(dependencies.rule(args.output or args.sources[0]))
    if classes and importlib.util.find_spec("numba") is None:
        print("rtcf-compile: needs numba: sudo apt install python3-numba", file=sys.stderr)
        return REFUSED
    compiled = _compiled(classes, report) if classes else []
    if not report and args.verify is not None:
        with report.collected():
            if not _verified(classes, compiled, args):
                return DIFFERENT
    if not report and args.output is not None:
        from rtcf_compile.library import build

        with report.collected():
            build.library(compiled, args.output)
            dependencies.set_time(args.output, begin_ns)
    return _reported(report)


def _reported(report: "Report") -> int:
    for line in report.lines():
        print(f"rtcf-compile: {line}", file=sys.stderr)
    return REFUSED if report else DONE


def _compiled(classes: list[type], report: "Report") -> list[Any]:
    """Return the classes as machine code, as far as they have no errors."""
    # Importing numba takes a second: import it only after the cheap checks.
    from rtcf.component import DeclarationError

    from rtcf_compile.library import log_text
    from rtcf_compile.machine_code import object_file
    from rtcf_compile.rewriting.functions import check_syntax

    # Otherwise a tenth of the time goes into searches for garbage.
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)
    compiled = []
    for each in classes:
        with report.collected():
            try:
                compiled.append(object_file.compile_component(each))
                log_text.check(compiled[-1].logs)
            except DeclarationError:
                with report.collected():
                    check_syntax(each)
                raise
    return compiled


def _verified(classes: list[type], compiled: list[Any], args: argparse.Namespace) -> bool:
    from rtcf_compile.comparison import watched

    amount = watched.Amount.parse(args.verify)
    found = watched.compare_all(classes, compiled, amount, args.seed)
    for each in found:
        print("\n".join([str(each), *each.conditions()]))
    problem = next((each.problem for each in found if each.problem), "")
    if problem:
        print(f"rtcf-compile: {' '.join(problem.split())}", file=sys.stderr)
    return not problem


def _classes(files: list[Path], report: "Report") -> list[type]:
    """Return the component classes of the files, as far as they run without errors."""
    from rtcf_compile.source import modules as source
    from rtcf_compile.source.mistake import Mistake

    found: dict[str, type] = {}
    for file in files:
        with report.collected():
            here = source.components(source.load(file))
            if not here:
                raise Mistake(
                    str(file),
                    0,
                    "has no component",
                    "define class Name(Component): with `def update(self):`",
                )
            for each in here:
                if each.__name__ in found:
                    raise Mistake(str(file), 0, f"{each.__name__} is defined twice", "rename one")
                found[each.__name__] = each
    return list(found.values())
