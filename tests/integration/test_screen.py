"""`rtcfctl top` and `plot`: on a terminal, which is left as it was found, and elsewhere."""

import json
import os
import pty
import re
import select
import signal
import subprocess
import termios
import time
from collections.abc import Iterator

import pytest
import rtcf
from daemon_process import BUILD_TREE, DEADLINE_S, Daemon

_LEFT = b"\x1b[?7h\x1b[?25h\x1b[?1049l"


class Terminal:
    """A terminal with a command in it."""

    def __init__(self, daemon: Daemon, *words: str, columns: int = 80, lines: int = 24) -> None:
        self._ours, self.theirs = pty.openpty()
        termios.tcsetwinsize(self.theirs, (lines, columns))
        self.before = termios.tcgetattr(self.theirs)
        self.process = subprocess.Popen(
            [BUILD_TREE / "bin" / "rtcfctl", *words],
            env=daemon.environment() | {"NO_COLOR": "1"},
            stdin=self.theirs, stdout=self.theirs, stderr=self.theirs,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )  # fmt: skip
        self.shown = b""

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.theirs)
        os.close(self._ours)

    def see(self, pattern: str) -> str:
        """Wait for something in the picture that is drawn last; return that picture."""
        deadline = time.monotonic() + DEADLINE_S
        while True:
            self._read()
            pictures = self.shown.decode(errors="replace").split("\x1b[H")
            # The last one may be half there.
            whole = pictures[-2] if len(pictures) > 2 else ""
            if re.search(pattern, whole):
                return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", whole)
            assert time.monotonic() < deadline, f"no {pattern} in {self.shown[-2000:]!r}"

    def press(self, keys: bytes) -> None:
        os.write(self._ours, keys)

    def end(self) -> int:
        """Wait for the end; return the exit status."""
        deadline = time.monotonic() + DEADLINE_S
        while self.process.poll() is None:
            assert time.monotonic() < deadline, self.shown[-2000:]
            self._read()
        self._read()
        return int(self.process.wait())

    def resize(self, columns: int, lines: int) -> None:
        termios.tcsetwinsize(self.theirs, (lines, columns))

    def _read(self) -> None:
        while select.select([self._ours], [], [], 0.05)[0]:
            self.shown += os.read(self._ours, 65536)
            if len(self.shown) > 10_000_000:
                return


@pytest.fixture
def terminals() -> Iterator[list[Terminal]]:
    opened: list[Terminal] = []
    yield opened
    for each in opened:
        each.close()


def test_top_draws_what_a_loop_costs(running: Daemon, terminals: list[Terminal]) -> None:
    terminals.append(terminal := Terminal(running, "top", "--interval", "200ms"))
    picture = terminal.see(r"/mimo +\d+\.\d\d")
    lines = picture.split("\r\n")
    assert lines[0].startswith("rt_runner  running  1000 Hz  cycle ")
    assert max(len(line) for line in lines) <= 80
    assert [line.split()[0] for line in lines if line.startswith("/")] == ["/mimo", "/wave"]
    terminal.press(b"s")  # by the mean: a sine takes longest
    terminal.see(r"/wave[^\n]*\n/mimo")
    terminal.press(b"r")
    terminal.resize(60, 9)
    picture = terminal.see(r"more")
    assert max(len(line) for line in picture.split("\r\n")) <= 60
    terminal.press(b"q")
    assert terminal.end() == 0
    assert terminal.shown.endswith(_LEFT)
    assert termios.tcgetattr(terminal.theirs) == terminal.before


@pytest.mark.parametrize("words", [("top", "--interval", "100ms"), ("plot", "wave")])
@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]
)
def test_the_terminal_is_left_as_it_was_found(
    running: Daemon,
    terminals: list[Terminal],
    words: tuple[str, ...],
    number: signal.Signals,
    code: int,
) -> None:
    terminals.append(terminal := Terminal(running, *words))
    terminal.see("wave")
    terminal.process.send_signal(number)
    assert terminal.end() == code
    assert _LEFT in terminal.shown
    assert b"Traceback" not in terminal.shown
    assert termios.tcgetattr(terminal.theirs) == terminal.before


def test_top_goes_on_without_rtcfd_and_says_so(
    daemon: Daemon, client: rtcf.Client, terminals: list[Terminal]
) -> None:
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave"))
    client.start()
    terminals.append(terminal := Terminal(daemon, "top", "--interval", "200ms"))
    terminal.see(r"/wave +\d")
    client.unload(["wave"])
    client.stop()
    terminal.see(r"rt_runner  stopped")


def test_elsewhere_each_look_is_a_table(running: Daemon) -> None:
    done = running.ctl("top", "-n", "2", "--interval", "100ms")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("COMPONENT") == 2
    assert "\x1b" not in done.stdout
    (told,) = map(json.loads, running.ctl("top", "-n", "1", "-o", "json").stdout.splitlines())
    assert [each["component"] for each in told["statistics"]["components"]] == ["/mimo", "/wave"]


def test_plot_draws_curves(running: Daemon, terminals: list[Terminal]) -> None:
    done = running.ctl("plot", "wave.wave", "wave.phase", "--span", "1s")
    assert done.returncode == 0, done.stderr
    head, *lines, below = done.stdout.splitlines()
    assert "/wave.wave" in head and "/wave.phase" in head
    assert len(lines) == 22 and below.split() == ["-1", "s", "now"]
    # From one end to the other, as a whole wave is in sight.
    assert all(any("\u2800" < each <= "\u28ff" for each in line) for line in lines)
    assert (lines[0].split()[0], lines[-1].split()[0]) == ("1", "-1")
    terminals.append(terminal := Terminal(running, "plot", "wave", "--span", "500ms"))
    picture = terminal.see("/wave.phase")
    assert max(len(line) for line in picture.split("\r\n")) <= 80
    terminal.press(b"q")
    assert terminal.end() == 0
    assert terminal.shown.endswith(_LEFT)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("top", "--interval", "0"), 2, "--interval 0: from 0.1 to 3600 s"),
        (("top", "-n", "0"), 2, "-n 0: at least 1"),
        (("top", "-r", "nobody"), 1, '"nobody"'),
        (("plot", "nobody"), 1, "nobody matches no output of fixed size and no state"),
        (("plot", "wave", "--span", "0"), 2, "--span 0: more than 0"),
        (("plot", "wave", "-o", "json"), 2, "a plot is for people"),
    ],
)
def test_refused_in_a_line(running: Daemon, words: tuple[str, ...], code: int, said: str) -> None:
    done = running.ctl(*words)
    assert done.returncode == code
    assert said in done.stderr.splitlines()[-1]
