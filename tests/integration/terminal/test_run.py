"""`rtcfctl run`: a loop in a private daemon, reloading saved and rebuilt files."""

import os
import shutil
import signal
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rtcf
from daemon_process import BUILD_TREE, NO_ROS, Daemon, clean_environment, wait_for
from rtcf.v1 import runner_pb2

_STRANGER = 54321  # an unused uid
_DEADLINE_S = 120.0  # for a compiler on a busy machine
GRAPH = """\
runner: rt_runner
settings:
  ros: {{enabled: false}}
components:
  - name: wave
    package: rtcf_examples
    type: Wave
    parameters: {{amplitude: {amplitude}}}
"""
COUNTS = """\
from rtcf.component import Component, Output, State


class Counts(Component):
    out: Output[int]
    count: State[int]

    def update(self):
        self.count += {step}
        self.out.write(self.count)
"""


class Running:
    """A running `rtcfctl run`, and its output."""

    def __init__(self, process: "subprocess.Popen[bytes]", out: Path, socket: Path) -> None:
        self.process = process
        self._out = out
        self.socket = socket

    @property
    def said(self) -> str:
        return self._out.read_text()

    def wait_for(self, text: str) -> None:
        wait_for(lambda: text in self.said or self.process.poll() is not None, text, _DEADLINE_S)
        assert text in self.said, self.said


@contextmanager
def running(folder: Path, *words: str, at: Path | None = None) -> Iterator[Running]:
    """Run it in a folder until Ctrl-C. `at`: its socket."""
    out, socket = folder / "said", at or folder / "s"
    environment = clean_environment() | {
        "PATH": f"{BUILD_TREE / 'bin'}:{os.environ['PATH']}",
        "XDG_CACHE_HOME": str(folder / "cache"),
    }
    with (
        out.open("wb") as to,
        subprocess.Popen(
            ["rtcfctl", "--socket", str(socket), "run", *words],
            cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=to, stderr=to,
            start_new_session=True,
        ) as process,
    ):  # fmt: skip
        found = Running(process, out, socket)
        try:
            yield found
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)


def amplitude(client: rtcf.Client) -> float:
    (found,) = (p for p in client.get_component("wave").parameters if p.name == "amplitude")
    return float(found.value.double_value)


def test_a_graph_file_runs_until_ctrl_c_and_is_reapplied_when_saved(
    tmp_path: Path,
) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(GRAPH.format(amplitude=1.5))
    with running(tmp_path, "graph.yaml") as loop:
        loop.wait_for("running; Ctrl-C ends it")
        assert f"from another terminal: rtcfctl --socket {loop.socket} status" in loop.said
        with rtcf.Client(loop.socket) as client:
            assert amplitude(client) == 1.5
            file.write_text(GRAPH.format(amplitude=2.5))
            loop.wait_for("reloaded graph.yaml")
            assert amplitude(client) == 2.5
            file.write_text(GRAPH.format(amplitude="[much"))
            loop.wait_for("rtcfctl: graph.yaml:")
            assert amplitude(client) == 2.5, "the running graph stays"
            (status,) = client.get_status().runners
        executor = status.pid
        loop.process.send_signal(signal.SIGINT)
        assert loop.process.wait() == 0
    assert not loop.socket.exists()
    assert not Path(f"/proc/{executor}").exists()
    assert loop.said.count("rtcfctl: graph.yaml:") == 1, "the message occurs once"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_termination_leaves_no_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    (tmp_path / "graph.yaml").write_text(GRAPH.format(amplitude=1.5))
    left = tmp_path / "left"
    left.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(left))
    with running(tmp_path, "graph.yaml", at=left / "s") as loop:
        loop.wait_for("running; Ctrl-C ends it")
        loop.process.send_signal(number)
        assert loop.process.wait() == 0
    # The loops of all private daemons of the user share this one.
    assert [each.name for each in left.iterdir()] == ["rtcf-cpus"]


def test_incidents_are_kept_until_it_ends(tmp_path: Path) -> None:
    (tmp_path / "graph.yaml").write_text(GRAPH.format(amplitude=1.5))
    with running(tmp_path, "graph.yaml") as loop:
        loop.wait_for("running; Ctrl-C ends it")
        with rtcf.Client(loop.socket) as client:
            taken = client.take_incident(reason="on request")
            assert client.list_incidents() == [taken]
            with (tmp_path / "copy.mcap").open("wb") as to:
                client.get_incident(to)
    assert not Path(taken.file).exists()
    with rtcf.read_recording(tmp_path / "copy.mcap") as copy:
        assert copy.metadata["incident"]["reason"] == "on request"


def test_tuned_values_stay_when_a_graph_file_is_saved(tmp_path: Path) -> None:
    def values() -> dict[str, float]:
        found = client.get_component("wave").parameters
        return {each.name: each.value.double_value for each in found}

    file = tmp_path / "graph.yaml"
    file.write_text(GRAPH.format(amplitude=1.5))
    with running(tmp_path, "graph.yaml") as loop:
        loop.wait_for("running; Ctrl-C ends it")
        with rtcf.Client(loop.socket) as client:
            tuned = [rtcf.parse_parameter(each) for each in ("amplitude:=3.5", "rate:=7")]
            client.set_parameters("wave", tuned)
            before = client.get_history("wave")
            file.write_text("# saved\n" + GRAPH.format(amplitude=1.5))
            loop.wait_for("reloaded graph.yaml")
            assert "/wave keeps amplitude = 3.5, rate = 7.0, set since" in loop.said
            assert (values()["amplitude"], values()["rate"]) == (3.5, 7.0)
            assert client.get_history("wave") == before, "a save sets nothing"
            # The new value in the file applies.
            file.write_text(GRAPH.format(amplitude=2.5))
            wait_for(lambda: values()["amplitude"] == 2.5, "the file's value", _DEADLINE_S)
            assert values()["rate"] == 7.0
            (last,) = client.get_history("wave")[len(before) :]
            assert (last.how, last.parameter) == ("apply", "amplitude")
            assert (last.before.double_value, last.value.double_value) == (3.5, 2.5)


def test_a_rebuilt_library_is_swapped_in(tmp_path: Path) -> None:
    # A package that exists nowhere else.
    library = tmp_path / "build" / "lib" / "rtcf" / "my_waves" / "my_waves.so"
    library.parent.mkdir(parents=True)
    shutil.copy(BUILD_TREE / "lib" / "rtcf" / "rtcf_examples" / "rtcf_examples.so", library)
    graph = GRAPH.format(amplitude=1.5).replace("rtcf_examples", "my_waves")
    (tmp_path / "graph.yaml").write_text(graph)
    with running(tmp_path, "graph.yaml") as loop:
        loop.wait_for("running; Ctrl-C ends it")
        with rtcf.Client(loop.socket) as client:
            client.set_parameters("wave", [rtcf.parse_parameter("rate:=3.0")])
            begun = library.with_suffix(".part")
            shutil.copy(library, begun)
            begun.rename(library)
            loop.wait_for("reloaded 1 component of rebuilt libraries")
            (status,) = client.get_status().runners
            assert status.overruns < status.iteration
            (wave,) = client.list_components()
            assert not wave.library_changed
            (rate,) = (p for p in wave.parameters if p.name == "rate")
            assert rate.value.double_value == 3.0, "the tuned value stays"
            library.write_bytes(b"half of a library")
            loop.wait_for("rtcfctl: ")
            (wave,) = client.list_components()
            assert wave.library_changed, "the old code still runs"


def test_a_python_source_is_compiled_and_swapped_in_when_saved(tmp_path: Path) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS.format(step=1))
    with running(tmp_path, "counts.py", "Counts") as loop:
        loop.wait_for("running; Ctrl-C ends it")
        with rtcf.Client(loop.socket) as client:
            source.write_text(COUNTS.format(step="[]"))
            loop.wait_for("rtcfctl: ")
            source.write_text(COUNTS.format(step=-1))
            loop.wait_for("reloaded counts.py")
            with client.watch_ports(["/Counts.out"]) as stream:
                values = next(iter(stream))["/Counts.out"]
    assert (values[1:] < values[:-1]).all()


def test_a_python_source_that_differs_from_the_interpreter_does_not_run(tmp_path: Path) -> None:
    source = tmp_path / "counts.py"
    differs = "1 + self.count * 10**18 % 7"
    source.write_text(COUNTS.format(step=differs))
    with running(tmp_path, "counts.py", "Counts") as loop:
        assert loop.process.wait() == 1
        assert "--no-verify skips this" in loop.said
    with running(tmp_path, "counts.py", "Counts", "--no-verify") as loop:
        loop.wait_for("running; Ctrl-C ends it")


def test_a_saved_python_source_that_differs_does_not_change_the_loop(
    tmp_path: Path,
) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS.format(step=1))
    with running(tmp_path, "counts.py", "Counts") as loop:
        loop.wait_for("running; Ctrl-C ends it")
        source.write_text(COUNTS.format(step="1 + self.count * 10**18 % 7"))
        loop.wait_for("--no-verify skips this")
        source.write_text(COUNTS.format(step=-1))
        loop.wait_for("reloaded counts.py")
    assert loop.said.count("--no-verify skips this") == 1, "the message occurs once"


def test_a_loop_may_be_left_stopped(tmp_path: Path) -> None:
    (tmp_path / "graph.yaml").write_text(GRAPH.format(amplitude=1.5))
    with running(tmp_path, "graph.yaml", "--no-start") as loop:
        loop.wait_for("stopped; Ctrl-C ends it")
        with rtcf.Client(loop.socket) as client:
            (status,) = client.get_status().runners
            assert status.iteration == 0


def test_the_end_of_its_daemon_is_reported(tmp_path: Path) -> None:
    (tmp_path / "graph.yaml").write_text(GRAPH.format(amplitude=1.5))
    with running(tmp_path, "graph.yaml") as loop:
        loop.wait_for("running; Ctrl-C ends it")
        (daemon,) = Path(f"/proc/{loop.process.pid}/task/{loop.process.pid}/children").read_text(
        ).split()  # fmt: skip
        os.kill(int(daemon), signal.SIGKILL)
        assert loop.process.wait() in (1, 3)
    assert "rtcfctl: " in loop.said.splitlines()[-1]


def test_a_daemon_that_already_uses_its_socket_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "graph.yaml").write_text(GRAPH.format(amplitude=1.5))
    (tmp_path / "other").mkdir()
    other = Daemon(tmp_path / "other", NO_ROS)
    other.start()
    try:
        with rtcf.Client(other.socket) as client:
            client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
            with running(tmp_path, "graph.yaml", at=other.socket) as loop:
                assert loop.process.wait() == 1
            assert f"a daemon answers at {other.socket} already" in loop.said
            assert client.get_order() == ["/steady"]
            (status,) = client.get_status().runners
            assert status.state == runner_pb2.RUNNER_STATE_STOPPED
    finally:
        other.end()


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to act as another user")
def test_a_socket_of_another_user_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "graph.yaml").write_text(GRAPH.format(amplitude=1.5))
    path = tmp_path / "theirs"
    with socket.socket(socket.AF_UNIX) as theirs:
        theirs.bind(str(path))
        os.chown(path, _STRANGER, _STRANGER)
        theirs.listen()
        theirs.setblocking(False)
        with running(tmp_path, "graph.yaml", at=path) as loop:
            assert loop.process.wait() == 1
        assert loop.said == (
            f"rtcfctl: {path} belongs to another user (uid {_STRANGER}): choose another --socket\n"
        )
        with pytest.raises(BlockingIOError):
            theirs.accept()
    assert path.exists(), "the other user's socket stays"


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("none.yaml",), 1, "none.yaml: No such file or directory"),
        (("none.py", "Counts"), 1, "none.py: no such file"),
        (("graph.yaml", "Counts"), 2, "run: specify a graph file, or FILE.py and CLASS"),
        (("counts.py",), 2, "run: specify a graph file, or FILE.py and CLASS"),
        (("graph.yaml", "--path", "nowhere"), 2, "--path nowhere: no such folder"),
        (("wrong.yaml",), 1, 'no package "none"'),
    ],
)
def test_errors_are_one_line(tmp_path: Path, words: tuple[str, ...], code: int, said: str) -> None:
    (tmp_path / "graph.yaml").write_text(GRAPH.format(amplitude=1.5))
    wrong = GRAPH.format(amplitude=1.5).replace("rtcf_examples", "none")
    (tmp_path / "wrong.yaml").write_text(wrong)
    with running(tmp_path, *words) as loop:
        assert loop.process.wait() == code, loop.said
    line = next(each for each in loop.said.splitlines() if each.startswith("rtcfctl: "))
    assert said in line
    assert not loop.socket.exists()
