"""A check of a component under RealtimeSanitizer, in a separate process and without rtcfd.

It uses the executor built with RealtimeSanitizer (Debian package rtcf-check).
"""

import os
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from rtcf_shared.errors import RtcfError
from rtcf_shared.folders import component_folders, packages
from rtcf_shared.naming import listing, suggestion

from rtcf.sanitizer import Violation, violations

INSTALLED = Path("/usr/lib/rtcf/rtcf-executor-rtsan")
CONFIGURATION = Path("/etc/rtcfd/rtcfd.toml")
_DESCRIBE_TIMEOUT_S = 30.0
# The sanitizer selects the protocol by the program's name. rtcf-check depends on the package of the
# last program; the others are faster, but belong to LLVM packages.
_SYMBOLIZERS = ("llvm-symbolizer-22", "llvm-symbolizer", "addr2line")
# Longest time without output, for one hook or some updates. The stall monitor of a loop is stricter
# by default.
_HANG_S = 10.0
# Longest time without output within a report: the look-up of source lines can be slow.
_REPORT_S = 120.0
_POLL_S = 0.05
_BEGIN, _END = "==ERROR: RealtimeSanitizer: ", "SUMMARY: "


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
    process = _GuardedProcess(command, os.environ | {"RTSAN_OPTIONS": sanitizer_options()})
    status = process.wait()
    lines = process.errors
    found = Checked(str(library), list(violations(lines)))
    found.log = [line for line in lines if line.startswith("/checked: ")]
    found.not_finite = [
        line.removeprefix("not finite: /") for line in lines if line.startswith("not finite: /")
    ]
    found.undeclared = [
        line.removeprefix("undeclared: ") for line in lines if line.startswith("undeclared: ")
    ]
    found.ended = process.hang or (_why(status, lines, process.stage) if status else "")
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


class _GuardedProcess:
    """A process that runs a component and is killed after too long without output.

    It writes each stage to standard output before the stage begins, and reports to standard error.
    Owned by the caller of wait().
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str]) -> None:
        self.stage = ""  # the present stage
        self.errors: list[str] = []  # lines of standard error
        self.hang = ""  # a message if the component did not return
        self._heard = time.monotonic()
        self._reporting = False
        self._process = subprocess.Popen(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
        assert self._process.stdout is not None and self._process.stderr is not None
        self._readers = [
            threading.Thread(target=self._read_stages, args=(self._process.stdout,)),
            threading.Thread(target=self._read_errors, args=(self._process.stderr,)),
        ]

    def wait(self, hang_s: float = _HANG_S) -> int:
        """Wait for the end of the process; return its exit status, negative for a signal.

        The process is killed after `hang_s` without output.
        """
        for reader in self._readers:
            reader.start()
        try:
            while self._process.poll() is None:
                limit = _REPORT_S if self._reporting else hang_s
                if time.monotonic() - self._heard > limit:
                    self.hang = (
                        f"the component does not return: no progress for {limit:g} s while "
                        f"{self.stage or 'loading'}"
                    )
                    self._process.kill()
                    break
                time.sleep(_POLL_S)
        finally:
            self._process.kill()
            self._process.wait()
        for reader in self._readers:
            reader.join()
        return self._process.returncode

    def _read_stages(self, stream: IO[str]) -> None:
        for line in stream:
            self.stage = line.strip()
            self._heard = time.monotonic()

    def _read_errors(self, stream: IO[str]) -> None:
        for line in stream:
            text = line.rstrip("\n")
            self.errors.append(text)
            self._reporting = _BEGIN in text or (self._reporting and not text.startswith(_END))
            self._heard = time.monotonic()
