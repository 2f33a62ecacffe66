"""The cache of compiled Python sources: no interruption, save or other process makes it give the
library of another text. The compiler here copies the source into the library.
"""

import os
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import pytest
from rtcfctl.graph import python_source


class Copying:
    """Stands for rtcf-compile."""

    def __init__(self, source: Path, helper: Path) -> None:
        self._source, self._helper = source, helper
        self.count = 0
        self.meanwhile: Callable[[], None] = lambda: None

    def run(
        self, arguments: Sequence[str], progress: Callable[[str], None]
    ) -> tuple[int, list[str]]:
        self.count += 1
        given = dict(pairwise(arguments))
        text = self._source.read_text() + self._helper.read_text()
        Path(given["--depfile"]).write_text(f"x: {self._source} {self._helper}\n")
        if "-o" in given:
            library = Path(given["-o"])
            library.parent.mkdir(parents=True, exist_ok=True)
            library.write_text(text)
        self.meanwhile()
        return 0, []


class Sources:
    """A source, a helper in another folder, and the cache."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.source, self.helper = folder / "own" / "own.py", folder / "other" / "other.py"
        for file in (self.source, self.helper):
            file.parent.mkdir()
            file.write_text(f"{file.stem} 1\n")
            os.utime(file, (1e9, 1e9))  # not while it is compiled
        self.compiler = Copying(self.source, self.helper)

    def load(self) -> str:
        """Return the content of the library that a load uses."""
        package = python_source.compiled(
            str(self.source), None, lambda line: None, False, self.compiler
        )
        (library,) = (self.folder / "cache").glob(f"**/{package}/own.so")
        return library.read_text()

    def present(self) -> str:
        return self.source.read_text() + self.helper.read_text()


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Sources:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return Sources(tmp_path)


def test_an_unchanged_source_is_compiled_once(sources: Sources) -> None:
    for _ in range(3):
        assert sources.load() == sources.present()
    assert sources.compiler.count == 1
    sources.helper.write_text("other 2\n")
    assert sources.load() == sources.present()
    assert sources.compiler.count == 2


def test_an_interruption_after_the_library_was_written_does_no_harm(sources: Sources) -> None:
    sources.load()
    before = sources.source.read_text()
    sources.source.write_text("own 2\n")

    def interrupted() -> None:
        raise KeyboardInterrupt

    sources.compiler.meanwhile = interrupted
    with pytest.raises(KeyboardInterrupt):
        sources.load()
    sources.compiler.meanwhile = lambda: None
    sources.source.write_text(before)
    assert sources.load() == sources.present()


def test_a_source_that_is_saved_in_every_compilation_is_compiled_again(sources: Sources) -> None:
    def saved() -> None:
        sources.source.write_text(f"own {sources.compiler.count + 1}\n")

    sources.compiler.meanwhile = saved
    sources.load()
    sources.compiler.meanwhile = lambda: None
    assert sources.load() == sources.present()


def test_two_processes_do_not_take_each_others_dependencies(
    sources: Sources, monkeypatch: pytest.MonkeyPatch
) -> None:
    def other() -> None:
        # Another process begins to compile, and is interrupted.
        monkeypatch.setattr(os, "getpid", lambda: 1)
        python_source._Place(sources.source).depfile()
        monkeypatch.undo()
        monkeypatch.setenv("XDG_CACHE_HOME", str(sources.folder / "cache"))

    sources.compiler.meanwhile = other
    sources.load()
    sources.compiler.meanwhile = lambda: None
    sources.helper.write_text("other 2\n")
    assert sources.load() == sources.present()


def test_a_cache_that_cannot_be_written_is_an_error_in_one_line(sources: Sources) -> None:
    (sources.folder / "cache").write_text("a file, no folder")
    with pytest.raises(python_source.NotCompiledError) as caught:
        sources.load()
    assert len(caught.value.lines) == 1
    assert "Not a directory" in str(caught.value)
