"""The commands of README's tour and of the manual pages' examples, run verbatim."""

import subprocess
from pathlib import Path

import pages
import rtcf
from daemon_process import BUILD_TREE, Daemon, clean_environment
from rtcf.v1 import runner_pb2
from values import state


def type_in(daemon: Daemon, lines: list[list[str]]) -> None:
    """Run rtcfctl commands, with the daemon's folder as /tmp; each must succeed."""
    for words in lines:
        done = daemon.ctl(*(word.replace("/tmp/", f"{daemon.folder}/") for word in words[1:]))
        assert done.returncode == 0, (words, done.stderr)


def test_the_tour_runs_as_documented(daemon: Daemon) -> None:
    lines = pages.tour()
    assert len(lines) > 10
    type_in(daemon, lines)
    assert "on_boot: start" in (daemon.folder / "tour.yaml").read_text()
    assert daemon.ctl("stop").returncode == 0


def test_the_example_of_rtcfctl_runs(daemon: Daemon, client: rtcf.Client) -> None:
    type_in(daemon, pages.commands("rtcfctl.1"))
    assert client.get_order() == ["/H1", "/F1"]
    assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING


def test_the_graph_of_the_example_is_applied(daemon: Daemon, client: rtcf.Client) -> None:
    file = daemon.folder / "graph.yaml"
    file.write_text(pages.example("rtcf-graph.5"))
    done = daemon.ctl("apply", str(file))
    assert done.returncode == 0, done.stderr
    assert client.get_order() == ["/A", "/B"]
    assert state(client).settings.frequency_hz == 2000


def test_the_settings_of_the_example_are_valid(tmp_path: Path) -> None:
    file = tmp_path / "rtcfd.toml"
    # With a user and a group that exist here.
    text = pages.example("rtcfd.toml.5")
    file.write_text(text.replace('"@shift"', '"@root"').replace('"alice"', '"root"'))
    done = subprocess.run(
        [BUILD_TREE / "bin" / "rtcfd", "--check-config", "--config", file,
         "--graphs-dir", tmp_path],
        env=clean_environment(), capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "settings and graphs are valid\n"), done.stderr


def test_the_program_of_the_example_runs(daemon: Daemon, client: rtcf.Client) -> None:
    done = subprocess.run(
        ["/usr/bin/python3", "-c", pages.example("rtcf-protocol.7")],
        env=daemon.environment() | {"PYTHONPATH": str(BUILD_TREE / "python")},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    float(done.stdout)
    assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING
