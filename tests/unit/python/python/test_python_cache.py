"""The cache of compiled functions changes the time of a compilation, never its result."""

import errno
import hashlib
import os
import py_compile
import subprocess
import sys
from collections.abc import Iterator
from enum import Enum, IntEnum
from pathlib import Path
from typing import Any

import pytest
from daemon_process import BUILD_TREE
from pages import TREE
from rtcf_compile.machine_code import cache as cache_module
from rtcf_compile.machine_code.cache import Cache
from rtcf_compile.machine_code.identity import Descriptions
from rtcf_compile.source import modules
from rtcfctl.graph.compiler import WarmCompiler

COMMAND = str(BUILD_TREE / "bin" / "rtcf-compile")
EXAMPLES = TREE / "components" / "rtcf_examples" / "python"
DEADLINE_S = 600.0
SOURCE = """\
import enum

import numpy as np
from gains import GAIN, scaled
from rtcf.component import Component, Output, Parameter, State

OFFSET = 0.5
TABLE = np.array([1.0, 2.0, 4.0])
PAIR = (3, 5)


class Mode(enum.IntEnum):
    OFF = 2
    RUN = 7


def limited(x, most=9.0):
    return min(x, most)


class Base(Component):
    y: Output[float]
    z: State[np.float64, 3]
    mode: State[Mode]
    count: State[int]

    STEP = 0.25

    def stepped(self, x):
        return x + self.STEP

    def _unused(self):
        return 1.0


class Changed(Base):
    kp: Parameter[float] = Parameter(1.5, min=0.0)

    def start(self):
        self.z = TABLE * OFFSET

    def update(self):
        self.count += PAIR[1]
        if self.mode is Mode.RUN:
            self.info("count {}", self.count)
            self.z += scaled(GAIN) * TABLE
        self.y.write(limited(self.stepped(self.z[0]) * self.kp))
"""
GAINS = """\
GAIN = 3.0


def scaled(x):
    return 2.0 * x
"""
# File, and the replaced and the new text.
CHANGES = {
    "constant of the module": ("changed.py", "OFFSET = 0.5", "OFFSET = 0.75"),
    "sign of a zero": ("changed.py", "OFFSET = 0.5", "OFFSET = -0.0"),
    "element of an array": ("changed.py", "2.0, 4.0]", "2.0, 8.0]"),
    "element of a tuple": ("changed.py", "PAIR = (3, 5)", "PAIR = (3, 6)"),
    "constant of another file": ("gains.py", "GAIN = 3.0", "GAIN = 4.0"),
    "function of another file": ("gains.py", "2.0 * x", "5.0 * x"),
    "default of a function": ("changed.py", "most=9.0", "most=8.0"),
    "function that is called": ("changed.py", "min(x, most)", "max(x, most)"),
    "constant of a class": ("changed.py", "STEP = 0.25", "STEP = 0.125"),
    "method of a base class": ("changed.py", "x + self.STEP", "x - self.STEP"),
    "declared size": ("changed.py", "y: Output[float]", "y: Output[float]\n    w: State[int]"),
    "declared type": ("changed.py", "count: State[int]", "count: State[np.int32]"),
    "value of an enum": ("changed.py", "RUN = 7", "RUN = 8"),
    "default of a parameter": ("changed.py", "Parameter(1.5,", "Parameter(2.5,"),
    "text of a log call": ("changed.py", "count {}", "number {}"),
    "type of a logged value": ('changed.py', 'self.count)', '0.5 * self.count)'),
    "name of the component": ("changed.py", "class Changed", "class Renamed"),
    "lines": ("changed.py", "OFFSET = 0.5", "\n\nOFFSET = 0.5"),
}  # fmt: skip


class Compilers:
    """A compiler that keeps functions in a folder, and one that keeps none."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self._monkeypatch = folder, monkeypatch
        self._kept = WarmCompiler(lambda: COMMAND, lambda: "")
        self._other = WarmCompiler(lambda: COMMAND, lambda: "")
        # The environment of a worker is that of its first compilation.
        for compiler, cache in ((self._kept, folder / "cache"), (self._other, Path("/dev/null"))):
            monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
            self._run(compiler, [])

    def end(self) -> None:
        self._kept.end()
        self._other.end()

    def kept(self, *sources: Path) -> bytes:
        return self._library(self._kept, sources)

    def fresh(self, *sources: Path) -> bytes:
        return self._library(self._other, sources)

    def kept_said(self, source: Path) -> tuple[int, list[str]]:
        return self._run(self._kept, [str(source), "-o", str(self.folder / "said.so")])

    def fresh_said(self, source: Path) -> tuple[int, list[str]]:
        return self._run(self._other, [str(source), "-o", str(self.folder / "said.so")])

    def _library(self, compiler: WarmCompiler, sources: tuple[Path, ...]) -> bytes:
        library = self.folder / "library.so"
        status, said = self._run(compiler, [*map(str, sources), "-o", str(library)])
        assert status == 0, said
        return library.read_bytes()

    def _run(self, compiler: WarmCompiler, words: list[str]) -> tuple[int, list[str]]:
        return compiler.run(words, lambda line: None)


@pytest.fixture(scope="module")
def compilers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Compilers]:
    with pytest.MonkeyPatch.context() as monkeypatch:
        both = Compilers(tmp_path_factory.mktemp("compilers"), monkeypatch)
        yield both
        both.end()


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_gives_the_library_of_a_new_compilation(
    name: str, compilers: Compilers, tmp_path: Path
) -> None:
    files = {"changed.py": SOURCE, "gains.py": GAINS}
    source = tmp_path / "changed.py"
    for file, text in files.items():
        (tmp_path / file).write_text(text)
    before = compilers.kept(source)
    file, old, new = CHANGES[name]
    assert old in files[file]
    (tmp_path / file).write_text(files[file].replace(old, new))
    after = compilers.kept(source)
    assert after != before
    assert after == compilers.fresh(source)


KINDS = """\
from dataclasses import dataclass


def half(x):
    return 0.5 * x


def third(x):
    return x / 3.0


@dataclass
class Range:
    low: float
    WIDTH = 7.0
    scaled = staticmethod(half)

    def middle(self):
        return self.low + 0.5 * self.WIDTH


def other(self):
    return self.low


@dataclass
class Wider(Range):
    WIDTH = 7.0
    scaled = staticmethod(half)
    middle = Range.middle
"""
RANGES = """\
from kinds import Range, Wider
from rtcf.component import Component, Input, Output


def width(p: Range):
    return p.WIDTH * p.low + p.scaled(p.low) + p.middle()


class Ranges(Component):
    u: Input[float]
    y: Output[float]

    def update(self):
        self.y.write(width(Wider(self.u.value)))
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("    WIDTH = 7.0\n    scaled = staticmethod(half)\n    middle",
         "    WIDTH = 8.0\n    scaled = staticmethod(half)\n    middle"),
        ("scaled = staticmethod(half)\n    middle", "scaled = staticmethod(third)\n    middle"),
        ("middle = Range.middle", "middle = other"),
    ],
    ids=["constant", "static method", "method"],
)  # fmt: skip
def test_a_subclass_that_differs_from_its_base_is_found_again(
    old: str, new: str, compilers: Compilers, tmp_path: Path
) -> None:
    (tmp_path / "ranges.py").write_text(RANGES)
    assert old in KINDS
    for text, is_accepted in ((KINDS, True), (KINDS.replace(old, new), False)):
        (tmp_path / "kinds.py").write_text(text)
        said = [
            each(tmp_path / "ranges.py") for each in (compilers.kept_said, compilers.fresh_said)
        ]
        assert said[0] == said[1]
        assert (said[0][0] == 0) == is_accepted


TABLES = """\
import numpy as np
from rtcf.component import Component, Output, State

LARGE = np.arange(200_000.0)
STEPS = np.arange(24.0).reshape(4, 6)[::2, ::-3]
PAIR = (STEPS.T[::-1], LARGE[::50_000])


class Tables(Component):
    OWN = LARGE[::100_000]

    y: Output[float]
    n: State[int]

    def update(self):
        self.n = (self.n + 1) % 2
        at = self.n
        first, second = PAIR
        total = LARGE[at + 150_000] + STEPS[at, 1]
        self.y.write(total + first[at, 0] + second[at + 1] + self.OWN[at])
"""


def test_arrays_of_constants_are_in_the_library(compilers: Compilers, tmp_path: Path) -> None:
    source = tmp_path / "tables.py"
    source.write_text(TABLES)
    # Other addresses in another process would give another library.
    assert compilers.kept(source) == compilers.fresh(source)
    done = subprocess.run([COMMAND, source, "--verify", "100"], timeout=DEADLINE_S, check=False)
    assert done.returncode == 0


@pytest.mark.parametrize("name", ["pid", "madgwick", "interpolator"])
def test_a_library_has_the_same_bytes_with_and_without_a_cache(
    name: str, compilers: Compilers
) -> None:
    source = EXAMPLES / f"{name}.py"
    fresh = compilers.fresh(source)
    assert compilers.kept(source) == compilers.kept(source) == fresh
    library = compilers.folder / "command.so"
    # Not in the worker.
    subprocess.run([COMMAND, source, "-o", library], check=True, timeout=DEADLINE_S)
    assert library.read_bytes() == fresh


def test_two_components_can_call_the_same_function(compilers: Compilers, tmp_path: Path) -> None:
    text = SOURCE.replace("from gains", "from gains_of_two")
    text += text[text.index("class Changed") :].replace("Changed(Base)", "Other(Base)").replace(
        "kp:", "first: State[int]\n    kp:"
    )  # fmt: skip
    (tmp_path / "two.py").write_text(text)
    (tmp_path / "gains_of_two.py").write_text(GAINS)
    assert compilers.kept(tmp_path / "two.py") == compilers.fresh(tmp_path / "two.py")
    (tmp_path / "two.py").write_text(text.replace("OFFSET = 0.5", "OFFSET = 0.625"))
    assert compilers.kept(tmp_path / "two.py") == compilers.fresh(tmp_path / "two.py")


def _compile(source: Path, cache: Path, library: Path) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [COMMAND, str(source), "-o", str(library)],
        env={"PATH": "/usr/bin:/bin", "XDG_CACHE_HOME": str(cache)},
        stderr=subprocess.PIPE,
        text=True,
    )


def _compiled(source: Path, cache: Path) -> bytes:
    library = cache / "library.so"
    process = _compile(source, cache, library)
    said = process.communicate(timeout=DEADLINE_S)[1]
    assert process.returncode == 0, said
    return library.read_bytes()


def test_damaged_files_are_compiled_again(tmp_path: Path) -> None:
    source = EXAMPLES / "butterworth.py"
    expected = _compiled(source, tmp_path)
    folder = tmp_path / "rtcf-components" / ".functions"
    files = sorted(folder.iterdir())
    assert files
    for number, file in enumerate(files):
        content = bytearray(file.read_bytes())
        if number % 3 == 0:
            content[len(content) // 2] ^= 1
        file.write_bytes([content, content[: len(content) // 2], b""][number % 3])
    assert _compiled(source, tmp_path) == expected
    # A file of another key is as damaged.
    first, second = files[:2]
    first.write_bytes(second.read_bytes())
    assert _compiled(source, tmp_path) == expected


def test_compilations_can_share_a_cache(tmp_path: Path) -> None:
    source = EXAMPLES / "butterworth.py"
    libraries = [tmp_path / f"{number}.so" for number in range(3)]
    running = [_compile(source, tmp_path, each) for each in libraries]
    for each in running:
        assert each.communicate(timeout=DEADLINE_S)[1] == ""
    assert len({each.read_bytes() for each in libraries}) == 1
    assert not list(tmp_path.glob("rtcf-components/.functions/.*"))


def test_the_folder_is_private(tmp_path: Path) -> None:
    folder = tmp_path / "kept"
    cache = Cache(folder)
    cache.write("key", b"content")
    assert folder.stat().st_mode & 0o777 == 0o700
    assert [each.stat().st_mode & 0o777 for each in folder.iterdir()] == [0o600]
    assert Cache(folder).read("key") == b"content"
    folder.chmod(0o770)
    assert Cache(folder).read("key") is None, "another user could have written it"
    Cache(folder).write("other", b"content")
    assert len(list(folder.iterdir())) == 1
    folder.chmod(0o700)
    link = tmp_path / "link"
    link.symlink_to(folder)
    assert Cache(link).read("key") is None


def test_a_full_disk_does_no_harm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cache = Cache(tmp_path / "kept")
    cache.write("first", b"content")

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "open", full)
    cache.write("second", b"content")
    monkeypatch.undo()
    assert [each.name for each in (tmp_path / "kept").iterdir()] == ["first"]
    Cache(Path("/dev/null/kept")).write("key", b"content")


def test_the_files_used_last_remain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache_module, "LIMIT", 5000)
    monkeypatch.setattr(cache_module, "_KEPT", 4000)
    cache = Cache(tmp_path / "kept")
    names = [hashlib.sha256(bytes([number])).hexdigest() for number in range(6)]
    for number, name in enumerate(names):
        cache.write(name, bytes(900))
        os.utime(tmp_path / "kept" / name, ns=(number, number))
    assert Cache(tmp_path / "kept").read(names[0]) == bytes(900)  # used again
    cache.remove_old()
    left = {each.name for each in (tmp_path / "kept").iterdir()}
    assert left == {names[0], *names[3:]}
    cache.write(names[1], bytes(4000))
    cache.remove_old()
    assert (tmp_path / "kept" / names[3]).exists()  # the last check was a moment ago
    mark = tmp_path / "kept-checked"
    for age_s in (601, -3600):
        cache.write(names[1], bytes(4000))
        os.utime(tmp_path / "kept" / names[1], ns=(1, 1))
        then = mark.stat().st_mtime_ns - age_s * 10**9
        os.utime(mark, ns=(then, then))
        cache.remove_old()
        assert not (tmp_path / "kept" / names[1]).exists()


def test_enums_with_other_bases_are_told_apart() -> None:
    bases: list[Any] = [IntEnum, Enum]
    first, second = (
        Descriptions().of(base("Mode", {"A": 1}, module="own", qualname="Mode")) for base in bases
    )
    assert first != second


def test_a_module_that_is_saved_twice_in_a_second_is_read_again(tmp_path: Path) -> None:
    source, other = tmp_path / "saved.py", tmp_path / "saved_other.py"
    for first, second in (("1.0", "2.0"), ("3.0", "4.0")):
        for file, text in (
            (source, "from saved_other import gain\nbias = {}\n"),
            (other, "gain = {}\n"),
        ):
            file.write_text(text.format(first))
            os.utime(file, (1e9, 1e9))
            py_compile.compile(str(file))
            file.write_text(text.format(second))
            os.utime(file, (1e9, 1e9))
        module = modules.load(source)
        del sys.modules["saved_other"]
        assert module.bias == float(second)
        assert module.gain == float(second)
