"""A check of a component under RealtimeSanitizer, in a separate process and without rtcfd.

It uses the executor built with RealtimeSanitizer (Debian package rtcf-check).
"""

import os
import shutil
import signal
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rtcf_shared.errors import RtcfError
from rtcf_shared.folders import component_folders, packages
from rtcf_shared.naming import listing, suggestion

from rtcf.sanitizer import Violation, violations
from rtcf.watched import Watched

INSTALLED = Path("/usr/lib/rtcf/rtcf-executor-rtsan")
CONFIGURATION = Path("/etc/rtcfd/rtcfd.toml")
_DESCRIBE_TIMEOUT_S = 30.0
# The sanitizer selects the protocol by the program's name. rtcf-check depends on the last one; the
# others are faster, but belong to LLVM packages.
_SYMBOLIZERS = ("llvm-symbolizer-22", "llvm-symbolizer", "addr2line")


@dataclass
class Checked:
    """The result of a check."""

    library: str
    violations: list[Violation] = field(default_factory=list)
    not_finite: list[str] = field(default_factory=list)  # outputs that had NaN or infinite values
    undeclared: list[str] = field(default_factory=list)  # members that change but are not State
    ended: str = ""  # a crash, an exit or a hang, in words; empty = a normal end
    log: list[str] = field(default_factory=list)  # the component's log records


def executor_of(build_tree: Path | None) -> Path:
    """Return the executor with RealtimeSanitizer of a build tree, or the installed one."""
    if build_tree is None:
        return INSTALLED
    return build_tree.with_name(f"{build_tree.name}-rtsan") / "bin" / "rtcf-executor"


def check(
    executor: Path,
    package: str,
    type_name: str,
    cycles: int,
    parameters: Sequence[str] = (),
    folders: Sequence[Path] = (),
    build_tree: Path | None = None,
) -> Checked:
    """Run a component for `cycles` cycles and return the violations of real-time rules.

    executor    an executor built with RealtimeSanitizer, see executor_of()
    parameters  "name:=value"
    folders     searched for libraries first, before those of rtcfd.toml and of the build tree

    Raises RtcfError if there is no such executor, package or type.
    """
    if not os.access(executor, os.X_OK):
        how = "install rtcf-check"
        if build_tree is not None and executor == executor_of(build_tree):
            how = f"build it with `make -C {build_tree.parent} checker`"
        raise RtcfError(
            f"no executor with RealtimeSanitizer at {executor}: {how}, or name one with --executor"
        )
    searched = component_folders([*folders, *_configured()], build_tree)
    library = _find(executor, searched, package, type_name)
    command = [str(executor), "--check", str(library), "--package", package, "--type", type_name,
               "--cycles", str(cycles)]  # fmt: skip
    for parameter in parameters:
        command += ["--param", parameter]
    watched = Watched(command, os.environ | {"RTSAN_OPTIONS": sanitizer_options()})
    status = watched.wait()
    lines = watched.errors
    found = Checked(str(library), list(violations(lines)))
    found.log = [line for line in lines if line.startswith("/checked: ")]
    found.not_finite = [
        line.removeprefix("not finite: /") for line in lines if line.startswith("not finite: /")
    ]
    found.undeclared = [
        line.removeprefix("undeclared: ") for line in lines if line.startswith("undeclared: ")
    ]
    found.ended = watched.hang or (_why(status, lines, watched.stage) if status else "")
    return found


def _find(executor: Path, folders: Sequence[Path], package: str, type_name: str) -> Path:
    """Return the library that provides a type, by the same rules as rtcfd."""
    # Imported here because only this function needs the executor's protocol.
    from rtcf.executor.v1 import executor_pb2

    known = packages(folders)
    if package not in known:
        listed = ", ".join(map(str, folders))
        raise RtcfError(
            f'no package "{package}" with component libraries in {listed}'
            f"{suggestion(package, known, most=1)}"
        )
    types: list[str] = []
    problems: list[str] = []
    for library in known[package]:
        try:
            done = subprocess.run(
                [executor, "--describe", library, "--package", package],
                capture_output=True,
                timeout=_DESCRIBE_TIMEOUT_S,
                check=False,
            )
        except subprocess.TimeoutExpired:
            problems.append(f"{library}: loading it timed out")
            continue
        description = executor_pb2.LibraryDescription()
        if done.returncode >= 0:
            description.ParseFromString(done.stdout)
        if done.returncode and not description.problem:
            description.problem = f"{library}: the process to load it failed"
        if description.problem:
            problems.append(" ".join(str(description.problem).split()))
        offered = [str(each.type) for each in description.types]
        if type_name in offered:
            return library
        types += offered
    raise RtcfError(
        "; ".join(
            [
                f'no type "{type_name}" in package "{package}"'
                f"{suggestion(type_name, types, most=1)} (types: {listing(types)})",
                *problems,
            ]
        )
    )


def sanitizer_options() -> str:
    """Return the sanitizer's options: report all violations, with an available symbolizer."""
    options = ["halt_on_error=false", "print_stats_on_exit=false"]
    symbolizer = next(filter(None, map(shutil.which, _SYMBOLIZERS)), None)
    if symbolizer:
        options.append(f"external_symbolizer_path={symbolizer}")
    return ":".join(options)


def _configured() -> list[Path]:
    """Return the component folders of /etc/rtcfd/rtcfd.toml."""
    import tomllib

    try:
        document = tomllib.loads(CONFIGURATION.read_text(encoding="utf-8"))
        return [Path(folder) for folder in document["daemon"]["path"]]
    except (OSError, KeyError, TypeError, ValueError):
        return []  # rtcfd reports an invalid file


def _why(status: int, lines: Sequence[str], stage: str) -> str:
    where = f" while {stage}" if stage else ""
    if status < 0:
        return f"the component crashed{where}: {signal.Signals(-status).name}"
    said = [line for line in lines if line.startswith("rtcf-executor: ")]
    if said:
        return said[-1].removeprefix("rtcf-executor: ")
    return f"the component ended its process{where}: exit status {status}"
