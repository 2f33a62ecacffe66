"""`rtcf-compile`: compile Python sources to a component library."""

import argparse
import gc
import importlib.util
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

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
    args = parser.parse_args(arguments)
    if args.output is None and args.verify is None:
        parser.error("give -o LIB, --verify or both")
    if args.verify is not None and not _AMOUNT.fullmatch(args.verify):
        parser.error(f"--verify {args.verify}: give cycles (10000) or seconds (1s)")
    from rtcf.component import DeclarationError

    from rtcf_compile.source.mistake import Mistake

    try:
        classes = _classes(args.sources)
        if importlib.util.find_spec("numba") is None:
            print("rtcf-compile: needs numba: sudo apt install python3-numba", file=sys.stderr)
            return REFUSED
        # Importing numba takes a second: import it only after the cheap checks.
        from rtcf_compile.library import build, log_text
        from rtcf_compile.machine_code import object_file

        # Otherwise a tenth of the time goes into searches for garbage.
        gc.freeze()
        gc.set_threshold(100_000, 20, 20)
        compiled = [object_file.compile_component(each) for each in classes]
        for each in compiled:
            log_text.check(each.logs)
        if args.verify is not None and not _verified(classes, compiled, args):
            return DIFFERENT
        if args.output is not None:
            build.library(compiled, args.output)
    except (Mistake, DeclarationError) as error:
        print(f"rtcf-compile: {' '.join(str(error).split())}", file=sys.stderr)
        return REFUSED
    except KeyboardInterrupt:
        return INTERRUPTED
    return DONE


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


def _classes(files: list[Path]) -> list[type]:
    from rtcf_compile.source import modules as source
    from rtcf_compile.source.mistake import Mistake

    found: dict[str, type] = {}
    for file in files:
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
