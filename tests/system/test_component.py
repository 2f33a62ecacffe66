"""Components with the installed packages alone: the examples, and a new one."""

import shutil
from pathlib import Path

from installed import Daemon, run


def test_example_runs(daemon: Daemon) -> None:
    daemon.ctl("load", "rtcf_examples", "Mimo", "--name", "M")
    daemon.ctl("start")
    assert "M" in daemon.ctl("order")
    daemon.ctl("stop")


def test_component_built_outside_the_tree_runs(tmp_path: Path, daemon: Daemon) -> None:
    source = tmp_path / "source"
    shutil.copytree(Path(__file__).parent / "offset", source)
    run("cmake", "-S", str(source), "-B", str(tmp_path / "build"), "-DCMAKE_INSTALL_PREFIX=/usr")
    run("cmake", "--build", str(tmp_path / "build"))
    run("cmake", "--install", str(tmp_path / "build"))

    daemon.ctl("load", "offset", "Offset", "--param", "offset:=2.5")
    daemon.ctl("start")
    daemon.ctl("stop")
    assert "2.5" in daemon.ctl("info", "Offset")
