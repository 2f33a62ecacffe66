"""A component's Python source given to rtcfctl: compiled, kept, swapped when it is saved."""

import importlib.machinery
import importlib.util
import platform
import re
import shutil
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import rtcf
from daemon_process import BUILD_TREE, DEADLINE_S, Daemon, wait_for
from rtcfctl.graph import python_source

COMPILE_DEADLINE_S = 900.0


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let rtcfctl and rtcfd have a cache of this test's own."""
    cache = tmp_path / "cache"
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    return cache


@pytest.fixture
def daemon(tmp_path: Path, own_cache: Path) -> Iterator[Daemon]:
    """Give an rtcfd that looks there."""
    daemon = Daemon(tmp_path)
    daemon.start()
    yield daemon
    if not daemon.ended:
        daemon.end()


def _states(client: rtcf.Client) -> dict[str, str]:
    return {each.name: each.value for each in client.get_component("Counts").states}


COUNTS = """\
from rtcf.component import Component, Output, State


class Counts(Component):
    out: Output[int]
    count: State[int]

    def update(self):
        self.count += STEP
        self.out.write(self.count)
"""


def test_a_source_is_loaded_swapped_when_it_is_saved_and_kept(
    own_cache: Path, tmp_path: Path, daemon: Daemon, client: rtcf.Client
) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS.replace("STEP", "1"))
    said = tmp_path / "said"
    with said.open("wb") as to:
        watching = subprocess.Popen(
            [str(BUILD_TREE / "bin" / "rtcfctl"), "load", str(source), "Counts", "--watch"],
            env=daemon.environment(),
            stdout=to,
            stderr=to,
        )
    try:
        wait_for(lambda: client.get_order() == ["/Counts"], "the component", COMPILE_DEADLINE_S)
        client.step(10)
        assert _states(client) == {"count": "10"}
        (library,) = own_cache.glob("rtcf-components/counts_*/counts.so")
        first = library.stat().st_mtime_ns
        source.write_text(COUNTS.replace("STEP", "1 + ["))
        wait_for(lambda: "counts.py:9: " in said.read_text(), "the line", COMPILE_DEADLINE_S)
        client.step(10)
        assert _states(client) == {"count": "20"}
        source.write_text(COUNTS.replace("STEP", "1000"))
        wait_for(lambda: "replaced /Counts" in said.read_text(), "the swap", COMPILE_DEADLINE_S)
        client.step(1)
        assert _states(client) == {"count": "1020"}
        assert library.stat().st_mtime_ns > first
    finally:
        watching.terminate()
        watching.wait(60)
    client.unload(["Counts"])
    second = library.stat().st_mtime_ns
    done = daemon.ctl("load", str(source), "Counts")
    assert done.returncode == 0, done.stderr
    assert library.stat().st_mtime_ns == second


def test_what_is_saved_while_a_source_is_compiled_is_seen(tmp_path: Path) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS)
    looks = python_source.looks(str(source))
    source.write_text(COUNTS + "\n")
    seeing = threading.Thread(target=lambda: next(saved for saved in looks if saved), daemon=True)
    seeing.start()
    seeing.join(DEADLINE_S)
    assert not seeing.is_alive()


def test_a_library_of_another_debian_counts_as_of_another_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "counts.py"
    source.write_text(COUNTS)
    ours = python_source.fingerprint(source)
    assert python_source.fingerprint(source) == ours
    monkeypatch.setattr(platform, "freedesktop_os_release", lambda: {"VERSION_ID": "14"})
    assert python_source.fingerprint(source) != ours


@pytest.mark.parametrize("changed", ["main.py", "library/shim.py", "library/runtime.hpp"])
def test_a_library_of_another_compiler_counts_as_of_another_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    found = importlib.util.find_spec("rtcf_compile")
    assert found is not None and found.origin is not None
    compiler = shutil.copytree(Path(found.origin).parent, tmp_path / "python" / "rtcf_compile")
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name: importlib.machinery.ModuleSpec(name, None, origin=str(compiler / "main.py")),
    )
    source = tmp_path / "counts.py"
    source.write_text(COUNTS)
    before = python_source.fingerprint(source)
    with (compiler / changed).open("a") as file:
        file.write("\n")
    assert python_source.fingerprint(source) != before


def test_a_source_that_is_wrong_is_refused_in_one_line(own_cache: Path, daemon: Daemon) -> None:
    source = daemon.folder / "counts.py"
    done = daemon.ctl("load", str(source), "Counts")
    assert (done.returncode, done.stderr) == (1, f"rtcfctl: {source}: no such file\n")
    source.write_text(COUNTS.replace("STEP", "None"))
    done = daemon.ctl("load", str(source), "Counts")
    assert done.returncode == 1
    assert re.fullmatch(r"rtcfctl: .*counts\.py:9: .*: .+\n", done.stderr), done.stderr
    done = daemon.ctl("load", "rtcf_examples", "Mimo", "--watch")
    assert done.returncode == 2 and "--watch is for a Python source" in done.stderr
