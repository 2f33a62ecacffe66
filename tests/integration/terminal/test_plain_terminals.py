"""Terminals without colours, without other characters than ASCII, or that cannot be cleared."""

import os
import pty
import subprocess

import pytest
from daemon_process import BUILD_TREE, DEADLINE_S, Daemon

SHOWING = ("top -n 1", "plot --once --span 0.2 wave.wave wave.phase", "graph", "status", "stats",
           "stats --plot", "list", "trace --help")  # fmt: skip


def _shown(daemon: Daemon, line: str, **environment: str) -> str:
    done = subprocess.run(
        [BUILD_TREE / "bin" / "rtcfctl", *line.split()],
        env=daemon.environment() | environment, stdin=subprocess.DEVNULL, capture_output=True,
        timeout=DEADLINE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.decode()


def _on_terminal(daemon: Daemon, line: str, **environment: str) -> str:
    """Return the output of a command on a terminal."""
    own, theirs = pty.openpty()
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", *line.split()], env=daemon.environment() | environment,
        stdin=theirs, stdout=theirs, stderr=theirs,
    )  # fmt: skip
    os.close(theirs)
    shown = b""
    try:
        while piece := os.read(own, 4096):
            shown += piece
    except OSError:
        pass  # the command has ended
    finally:
        os.close(own)
    assert process.wait(DEADLINE_S) == 0, shown
    return shown.decode()


@pytest.mark.parametrize("line", SHOWING)
def test_the_locale_c_gets_ascii(running: Daemon, line: str) -> None:
    shown = _shown(running, line, LC_ALL="C")
    assert shown.isascii() and shown.strip()
    assert "?" not in shown.replace("(?)", "").partition("usage")[0] or "--help" in line


def test_programs_get_all_characters_in_any_locale(running: Daemon) -> None:
    words = "list -o json"
    assert _shown(running, words, LC_ALL="C") == _shown(running, words, LC_ALL="C.UTF-8")


def test_curves_without_colours_differ_by_their_characters(running: Daemon) -> None:
    plain = _shown(running, SHOWING[1])
    legend, *rows = plain.split("\n")
    assert "* /wave.wave" in legend and "+ /wave.phase" in legend
    drawn = "".join(rows)
    assert "*" in drawn and "+" in drawn


@pytest.mark.parametrize("line", ["top -n 2 --interval 100ms", SHOWING[1]])
def test_a_dumb_terminal_gets_lines_only(running: Daemon, line: str) -> None:
    shown = _on_terminal(running, line.replace(" --once", ""), TERM="dumb")
    assert "\x1b" not in shown
    assert "wave" in shown
    assert "\x1b" in _on_terminal(running, "top -n 1", TERM="xterm")


def test_no_color_means_no_colours(running: Daemon) -> None:
    shown = _on_terminal(running, "status", TERM="xterm", NO_COLOR="1")
    assert "\x1b[3" not in shown
