"""The files of graphs.d: which of them count, and when they count as changed."""

from pathlib import Path

from rtcfd.state.boot_graphs import BootGraphs


def test_a_graph_counts_when_the_file_that_was_in_its_way_is_gone(tmp_path: Path) -> None:
    first, second = tmp_path / "a.yaml", tmp_path / "b.yaml"
    first.write_text("runner: arm\ncomponents: []\n")
    second.write_text("runner: arm\nsettings: {priority: 70}\ncomponents: []\n")
    graphs = BootGraphs(tmp_path, {})

    def read() -> tuple[list[tuple[str, bool]], list[str]]:
        found, problems = graphs.read()
        return [(each.file.name, each.changed) for each in found], problems

    problem = f"{second}: runner arm is in {first} already"
    assert read() == ([("a.yaml", True)], [problem])
    assert read() == ([("a.yaml", False)], [problem])
    first.unlink()
    assert read() == ([("b.yaml", True)], [])
    assert read() == ([("b.yaml", False)], [])
