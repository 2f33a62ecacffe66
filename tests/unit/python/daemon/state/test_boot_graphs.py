"""The files of graphs.d: which of them apply, and when they count as changed."""

from collections.abc import Callable
from pathlib import Path

import odd_files
import pytest
from rtcfd.state.boot_graphs import BootGraphs


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
