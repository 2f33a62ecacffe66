"""The executor built with RealtimeSanitizer, and its reports."""

from pathlib import Path

from daemon_process import BUILD_TREE, Daemon
from rtcf.checking import sanitizer_options
from rtcf.sanitizer import Violation, violations

EXECUTOR = BUILD_TREE.with_name(f"{BUILD_TREE.name}-rtsan") / "bin" / "rtcf-executor"
HOW_TO_BUILD = f"there is no {EXECUTOR}: `make checker` builds it"
# All reports: stopping at the first one would hide the others. Names are resolved by the tool
# that this machine has.
ENVIRONMENT = {"RTSAN_OPTIONS": sanitizer_options()}


def sanitized_daemon(folder: Path, settings: str) -> Daemon:
    """Return an rtcfd whose executors log calls that are not real-time safe."""
    assert EXECUTOR.exists(), HOW_TO_BUILD
    # A report is written within the cycle, and is slow.
    return Daemon(
        folder,
        "[runner]\nstall_timeout_ms = 60000\n" + settings,
        arguments=["--executor", str(EXECUTOR)],
        environment=ENVIRONMENT,
    )


def reports(daemon: Daemon) -> list[Violation]:
    """Return the reports so far; after the end of the daemon, these are all reports."""
    return list(violations(daemon.log().splitlines()))
