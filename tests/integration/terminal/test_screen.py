"""`rtcfctl top` and `plot`: in a terminal, which is restored afterwards, and elsewhere."""

import json
import re
import signal
import termios
from collections.abc import Iterator

import graphs
import pytest
import rtcf
from daemon_process import Daemon, signal_twice
from rtcf.v1.runner_pb2 import RunnerSettings
from terminal import Terminal

_LEFT = b"\x1b[?7h\x1b[?25h\x1b[?1049l"
_MANY = 200
_SIZES = ((80, 24), (60, 24), (100, 12), (132, 50))


@pytest.fixture
def terminals() -> Iterator[list[Terminal]]:
    opened: list[Terminal] = []
    yield opened
    for each in opened:
        each.close()


def rows(screen: str) -> list[str]:
    """Return the components on a screen of top."""
    return [line.split()[0] for line in screen.split("\n") if line.startswith("/")]


def test_top_shows_the_durations_of_a_loop(running: Daemon, terminals: list[Terminal]) -> None:
    terminals.append(terminal := Terminal(running, "top", "--interval", "200ms"))
    screen = terminal.see(r"/mimo +\d+\.\d\d")
    assert screen.startswith("rt_runner  running  1000 Hz  cycle ")
    assert rows(screen) == ["/mimo", "/wave"]
    terminal.press(b"s")  # by mean duration
    by_mean = terminal.see("▼MEAN").split("\n")
    means = [float(line.split()[1]) for line in by_mean if line.startswith("/")]
    assert len(means) == 2 and means == sorted(means, reverse=True)
    terminal.press(b"o")
    terminal.see(r"^/mimo[^\n]*\n/wave")
    terminal.press(b"r")
    terminal.press(b"q")
    assert terminal.end() == 0
    assert terminal.shown.endswith(_LEFT)
    assert termios.tcgetattr(terminal.theirs) == terminal.before


@pytest.fixture
def many(daemon: Daemon, client: rtcf.Client) -> Iterator[Daemon]:
    """Yield `daemon` with a running loop of many components."""
    # A loop that is late would need lines to say so.
    client.set_runner(RunnerSettings(frequency_hz=50.0))
    client.apply(graphs.chain(_MANY))
    client.start()
    yield daemon
    client.stop()


@pytest.mark.parametrize(("columns", "lines"), _SIZES)
def test_the_whole_head_fits_the_terminal(
    many: Daemon, terminals: list[Terminal], columns: int, lines: int
) -> None:
    terminal = Terminal(many, "top", "--interval", "200ms", columns=columns, lines=lines)
    terminals.append(terminal)
    screen = terminal.see(r"wake-up +mean [^/]* missed, [^/]*^/m000 ").split("\n")
    assert len(screen) == lines
    first = screen[0]
    assert re.fullmatch(r"rt_runner  running  50 Hz  cycle \d+ +\d\d:\d\d:\d\d", first)
    assert len(first) == columns
    (calculation,) = (each for each in screen if each.startswith("calculation"))
    assert re.search(r"mean +\d+\.\d\d  p99 +\d+\.\d\d  max +\d+\.\d+ µs", calculation)
    (counts,) = (each for each in screen if " missed" in each)
    assert re.fullmatch(r"\d+ overruns?, \d+ missed, \d+ page faults?", counts)
    # Missing real-time rights, as on machines that run tests, are wrapped, not cut.
    assert not any("…" in each for each in screen)
    (title,) = (each for each in screen if each.startswith("COMPONENT"))
    for word in ("MEAN", "P99", "MAX", "SHARE", "OVER"):
        assert word in title
    assert screen[-1].startswith("q end ")


def test_all_components_can_be_scrolled_to(many: Daemon, terminals: list[Terminal]) -> None:
    terminals.append(terminal := Terminal(many, "top", "--interval", "60s"))
    names = [graphs.name(number) for number in range(_MANY)]
    screen = terminal.see(r"^1 to \d+ of 200 components, in the order in which they run$")
    room = len(rows(screen))
    assert 5 < room < 24 and rows(screen) == names[:room]

    def at(first: int) -> None:
        screen = terminal.see(rf"^{first + 1} to {first + room} of 200 components")
        assert rows(screen) == names[first : first + room]

    for keys, first in (
        (b"\x1b[B", 1), (b"j", 2), (b"\x1b[A", 1), (b"k", 0), (b"k", 0),
        (b"jjj\x1b[B\x1b[Bkk", 3),  # as fast as a held key
        (b"\x1b[6~", 3 + room - 1), (b"\x1b[5~", 3), (b"\x1bOF", _MANY - room),
        (b"\x1b[6~", _MANY - room), (b"\x1b[H", 0), (b"\x1b[F", _MANY - room), (b"\x1b[1~", 0),
        (b"\x1b[200~\x1b[99;1u\x1bx", 0),  # keys without a function
    ):  # fmt: skip
        terminal.press(keys)
        at(first)
    for first in range(room - 1, _MANY, room - 1):
        terminal.press(b" ")
        at(min(first, _MANY - room))
    # A new sort order starts at its top.
    terminal.press(b"n")
    terminal.see(rf"^1 to {room} of 200 components, by name$")
    terminal.press(b"w")
    terminal.see(rf"^1 to {room} of 200 components, by maximum$")
    terminal.press(b"\x1b")
    assert terminal.end() == 0
    assert b"Traceback" not in terminal.shown


def test_a_new_size_is_drawn_immediately(many: Daemon, terminals: list[Terminal]) -> None:
    terminals.append(terminal := Terminal(many, "top", "--interval", "60s"))
    terminal.see(r"^1 to 1\d of 200")
    terminal.press(b"\x1b[F")
    terminal.see("to 200 of 200")
    for columns, lines in ((60, 10), (40, 5), (160, 60), (80, 24)):
        terminal.resize(columns, lines)
        screen = terminal.see(rf"^(?=.{{{columns}}}$)rt_runner  running .*\d\d:\d\d:\d\d$")
        assert len(screen.split("\n")) == lines
        terminal.press(b"\x1b[F")
        screen = terminal.see(" to 200 of 200 components")
        assert rows(screen)[-1] == graphs.name(_MANY - 1)


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
    signal_twice(terminal.process, number)
    assert terminal.end() == code
    assert _LEFT in terminal.shown
    assert b"Traceback" not in terminal.shown
    assert termios.tcgetattr(terminal.theirs) == terminal.before


def test_top_continues_without_rtcfd_and_reports_it(
    daemon: Daemon, client: rtcf.Client, terminals: list[Terminal]
) -> None:
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave"))
    client.start()
    terminals.append(terminal := Terminal(daemon, "top", "--interval", "200ms"))
    terminal.see(r"/wave +\d")
    client.unload(["wave"])
    client.stop()
    terminal.see(r"rt_runner  stopped")


def test_without_a_terminal_top_prints_tables(running: Daemon) -> None:
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
    # The curve spans the whole width, since a whole wave is visible.
    assert all(any(each in "*+" for each in line) for line in lines)
    assert (lines[0].split()[0], lines[-1].split()[0]) == ("1", "-1")
    terminals.append(terminal := Terminal(running, "plot", "wave", "--span", "500ms"))
    screen = terminal.see("/wave.phase")
    assert len(screen.split("\n")) == 24
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
        (("plot", "wave", "-o", "json"), 2, "plot has no output for programs"),
    ],
)
def test_errors_are_one_line(running: Daemon, words: tuple[str, ...], code: int, said: str) -> None:
    done = running.ctl(*words)
    assert done.returncode == code
    assert said in done.stderr.splitlines()[-1]
