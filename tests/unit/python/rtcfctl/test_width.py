"""rtcfctl's output fits a terminal of 80 columns, with names of any length."""

import os
import pty
import subprocess
import tempfile
import termios
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
import rtcf
from daemon_process import BUILD_TREE, DEADLINE_S
from daemon_under_test import DaemonUnderTest

COLUMNS = 80
# Each of a letter that occurs nowhere else.
COMPONENT, PORT, PACKAGE, TYPE, RUNNER = (letter * 60 for letter in "XQKZJ")
RUNNER = RUNNER[:50]


def on_a_terminal(daemon: DaemonUnderTest, command: Sequence[str]) -> list[str]:
    """Return the lines that rtcfctl shows in a terminal."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, COLUMNS))
    with subprocess.Popen(
        [str(BUILD_TREE / "bin" / "rtcfctl"), *command],
        env={**os.environ, "RTCF_SOCKET": str(daemon.socket), "NO_COLOR": "1"},
        stdin=subprocess.DEVNULL, stdout=theirs,
    ) as process:  # fmt: skip
        os.close(theirs)
        shown = b""
        try:
            while piece := os.read(ours, 65536):
                shown += piece
        except OSError:
            pass  # Linux reports the end of the other side's output this way
        finally:
            os.close(ours)
        assert process.wait(DEADLINE_S) == 0, command
    return shown.decode().splitlines()


@pytest.fixture(scope="module")
def daemon() -> Iterator[DaemonUnderTest]:
    """Yield a daemon whose runner, component, ports, package and type have long names."""
    # Most of the 107 characters of a socket's path belong to the runner's name.
    with tempfile.TemporaryDirectory() as folder:
        daemon = DaemonUnderTest(Path(folder))
        daemon.package(PACKAGE, types={TYPE: "fine"})
        daemon.environment["PEER_PORT"] = PORT
        daemon.start()
        with daemon.client() as client:
            client.add_runner(RUNNER)
            client.load(rtcf.component(PACKAGE, TYPE, name=COMPONENT, optional=True), RUNNER)
            client.set_parameters(COMPONENT, [rtcf.parse_parameter("kp:=0.1")], RUNNER)
            client.start(RUNNER)
        yield daemon
        daemon.end()


@pytest.mark.parametrize(
    ("command", "names"),
    [
        ("status", [RUNNER]),
        ("runner list", [RUNNER]),
        ("list", [COMPONENT, PACKAGE, TYPE]),
        (f"info {COMPONENT}", [COMPONENT, PACKAGE, TYPE, PORT]),
        ("order", [COMPONENT]),
        ("connections", [COMPONENT]),
        ("types", [PACKAGE, TYPE]),
        ("types --long", [PACKAGE, TYPE, PORT]),
        ("stats", [RUNNER, COMPONENT, "864000000", "123457"]),
        ("history", [COMPONENT]),
    ],
)
def test_no_line_is_too_wide_and_no_name_is_lost(
    daemon: DaemonUnderTest, command: str, names: list[str]
) -> None:
    lines = on_a_terminal(daemon, [*command.split(), "-r", RUNNER])
    shown = "\n".join(lines)
    # A heading is not a table: the terminal can wrap it without breaking columns.
    headings = (f"/{COMPONENT}: ", f"{PACKAGE}/")
    assert all(len(line) <= COLUMNS for line in lines if not line.startswith(headings)), shown
    for name in names:
        # Wrapped cells of one row are next to each other.
        assert name in shown or shown.count(name[0]) >= len(name), shown
