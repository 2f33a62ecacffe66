"""The executor that is built with RealtimeSanitizer, and what it has to say."""

from pathlib import Path

from daemon_process import BUILD_TREE, Daemon
from rtcf.checking import sanitizer_options
from rtcf.sanitizer import Violation, violations

EXECUTOR = BUILD_TREE.with_name(f"{BUILD_TREE.name}-rtsan") / "bin" / "rtcf-executor"
HOW_TO_BUILD = (
    f"there is no {EXECUTOR}: cmake -S . -B {EXECUTOR.parents[1].name} -G Ninja "
    "-DRTCF_SANITIZE=realtime -DCMAKE_CXX_COMPILER=clang++-22, and build rtcf-executor there"
)
# Of all reports, as a loop that was ended at the first would hide the others; with names by what
# this machine has for that.
ENVIRONMENT = {"RTSAN_OPTIONS": sanitizer_options()}


def sanitized_daemon(folder: Path, settings: str) -> Daemon:
    """Return an rtcfd whose executors report what is not real-time safe, into its log."""
    assert EXECUTOR.exists(), HOW_TO_BUILD
    # A report is made inside the cycle, and takes long.
    return Daemon(
        folder,
        "[runner]\nstall_timeout_ms = 60000\n" + settings,
        arguments=["--executor", str(EXECUTOR)],
        environment=ENVIRONMENT,
    )


def reports(daemon: Daemon) -> list[Violation]:
    """Return all that was reported so far; of an ended daemon, all."""
    return list(violations(daemon.log().splitlines()))
