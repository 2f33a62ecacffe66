"""The files of graphs.d: which of them apply, and when they count as changed."""

from collections.abc import Callable
from pathlib import Path

import odd_files
import pytest
import rtcf
from rtcf.v1 import runner_pb2
from rtcf_shared.graph_reader import read_graphs
from rtcfd.state.boot_graphs import BootGraphs, become
from rtcfd.state.desired import Desired


def test_a_graph_applies_once_the_conflicting_file_is_removed(tmp_path: Path) -> None:
    first, second = tmp_path / "a.yaml", tmp_path / "b.yaml"
    first.write_text("runner: arm\ncomponents: []\n")
    second.write_text("runner: arm\nsettings: {priority: 70}\ncomponents: []\n")
    graphs = BootGraphs(tmp_path, {})

    def read() -> tuple[list[tuple[str, bool]], list[str]]:
        found, problems = graphs.read()
        return [(each.file.name, each.changed) for each in found], problems

    problem = f"{second}: runner arm is already in {first}"
    assert read() == ([("a.yaml", True)], [problem])
    assert read() == ([("a.yaml", False)], [problem])
    first.unlink()
    assert read() == ([("b.yaml", True)], [])
    assert read() == ([("b.yaml", False)], [])


@pytest.mark.parametrize("odd", odd_files.ODD)
def test_an_unreadable_entry_is_one_line_and_the_others_apply(
    tmp_path: Path, odd: Callable[[Path], None]
) -> None:
    odd(tmp_path / "a.yaml")
    (tmp_path / "b.yaml").write_text("runner: arm\ncomponents: []\n")
    with odd_files.deadline():
        graphs, (problem,) = BootGraphs(tmp_path, {}).read()
    assert [each.file.name for each in graphs] == ["b.yaml"]
    assert problem.startswith(f"cannot read {tmp_path}/a.yaml: ")
    assert "[Errno" not in problem and "\n" not in problem


def test_a_link_to_a_missing_folder_is_an_error(tmp_path: Path) -> None:
    link = tmp_path / "graphs.d"
    assert BootGraphs(link, {}).read() == ([], [])
    odd_files.dangling(link)
    problem = f"cannot read {link}: it is a symbolic link that leads nowhere"
    assert BootGraphs(link, {}).read() == ([], [problem])


def test_the_changes_by_hand_that_a_file_replaces_are_listed() -> None:
    (graph,) = read_graphs(
        "runner: arm\nsettings: {priority: 60, ros: {queue: 4}}\ncomponents:\n"
        "  - {package: demo, type: Fine, name: a, parameters: {kp: 2.0}}\n",
        "arm.yaml",
    )
    desired = Desired("arm")
    assert become(desired, graph) == []
    assert become(desired, graph) == [], "nothing was changed by hand"
    desired.set_parameters("a", [rtcf.parse_parameter(each) for each in ("kp:=3.5", "ki:=0.5")])
    desired.put("/b", rtcf.component("demo", "Fine", name="b"))
    desired.choose(
        runner_pb2.RunnerSettings(
            priority=70, frequency_hz=500.0, ros=runner_pb2.RosSettings(queue=9)
        )
    )
    assert become(desired, graph) == [
        "priority 70 -> 60",
        "ros.queue 9 -> 4",
        "/a.kp 3.5 -> 2.0",
        "/a.ki 0.5 -> its default",
        "/b is removed",
    ]
