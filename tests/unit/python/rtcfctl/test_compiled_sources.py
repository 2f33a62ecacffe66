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
        self.status, self.writes = 0, True
        self.arguments: list[str] = []
        self.meanwhile: Callable[[], None] = lambda: None

    def run(
        self, arguments: Sequence[str], progress: Callable[[str], None]
    ) -> tuple[int, list[str]]:
        self.count += 1
        self.arguments = list(arguments)
        given = dict(pairwise(arguments))
        text = self._source.read_text() + self._helper.read_text()
        Path(given["--depfile"]).write_text(f"x: {self._source} {self._helper}\n")
        if "-o" in given and self.writes:
            library = Path(given["-o"])
            library.parent.mkdir(parents=True, exist_ok=True)
            library.write_text(text)
        status = self.status
        self.meanwhile()
        return status, []


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


def test_an_error_of_a_text_that_was_saved_meanwhile_is_not_the_last_word(sources: Sources) -> None:
    def saved() -> None:
        sources.source.write_text("own 2\n")
        sources.compiler.status = 0

    sources.compiler.status, sources.compiler.meanwhile = 3, saved
    assert sources.load() == sources.present()
    assert sources.compiler.count == 2

    def fails() -> None:
        sources.source.write_text(f"own {sources.compiler.count + 2}\n")

    sources.source.write_text("own 3\n")
    sources.compiler.status, sources.compiler.meanwhile = 3, fails
    with pytest.raises(python_source.NotCompiledError, match="status 3"):
        sources.load()


def test_a_compiler_that_writes_no_library_is_an_error(sources: Sources) -> None:
    sources.load()
    sources.source.write_text("own 2\n")
    sources.compiler.writes = False
    for _ in range(2):
        with pytest.raises(python_source.NotCompiledError, match="ended without a library"):
            sources.load()
    sources.compiler.writes = True
    assert sources.load() == sources.present()


def test_a_damaged_library_is_compiled_again(sources: Sources) -> None:
    sources.load()
    (library,) = (sources.folder / "cache").glob("**/own.so")
    library.write_text("")
    assert sources.load() == sources.present()


def test_an_rtcfd_with_another_cache_folder_does_not_find_the_package(
    sources: Sources, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = python_source._Place(sources.source).package
    monkeypatch.setenv("XDG_CACHE_HOME", str(sources.folder / "another"))
    assert python_source._Place(sources.source).package != before


def test_a_package_beside_the_source_that_may_hide_a_module_is_noticed(sources: Sources) -> None:
    sources.load()
    (sources.source.parent / "other").mkdir()
    (sources.source.parent / "other" / "__init__.py").write_text("")
    sources.load()
    assert sources.compiler.count == 2


def test_pipes_beside_the_source_are_not_read(sources: Sources) -> None:
    os.mkfifo(sources.source.parent / "pipe.py")
    assert sources.load() == sources.present()


def test_files_of_interrupted_compilations_are_removed(sources: Sources) -> None:
    sources.load()
    (library,) = (sources.folder / "cache").glob("**/own.so")
    package = library.parent.name
    dead, alive = 2**22 + 1, os.getppid()
    left = [library.parents[1] / f".{package}.{pid}.d" for pid in (dead, alive)]
    left += [library.parent / f".own.so.{pid}" for pid in (dead, alive)]
    for each in left:
        each.write_text("")
    sources.source.write_text("own 2\n")
    sources.load()
    assert [each.exists() for each in left] == [False, True, False, True]


def test_a_name_that_begins_with_a_hyphen_is_no_option(
    sources: Sources, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(sources.source.parent)
    Path("-own.py").write_text("own 1\n")
    python_source.compiled("-own.py", None, lambda line: None, False, sources.compiler)
    assert sources.compiler.arguments[0] == "./-own.py"
