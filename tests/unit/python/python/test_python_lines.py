"""Debug information of Python components: their files and lines, and unchanged code."""

import contextlib
import ctypes
import os
import re
import subprocess
from pathlib import Path
from unittest import mock

import pytest
from crash_traces import find, trace_of
from daemon_process import BUILD_TREE
from rtcf_compile.machine_code import object_file, source_lines
from rtcf_compile.source import modules

COMMAND = BUILD_TREE / "bin" / "rtcf-compile"
EXECUTOR = BUILD_TREE / "bin" / "rtcf-executor"
DEADLINE_S = 600.0
MODULE = """\
def größe(a, b):
    c = a * b
    return c + a
"""
SOURCE = """\
import math

from rtcf.component import Component, Input, Output, Parameter, State
from teile_ü import größe


class Base(Component):
    u: Input[float]
    out: Output[float]
    gain: Parameter[float] = Parameter(1.0)
    total: State[float]

    def scaled(self, value):
        return self.gain * value

    def update(self):
        self.total += 1.0 / (self.u.value + 2.0)


class Regler(Base):
    def start(self):
        self.total = 3.0

    def update(self):
        super().update()
        self.total += größe(self.u.value, self.total)
        self.out.write(math.sin(self.scaled(self.total)))
        self.info("total {}", self.total)
"""
LOGGED = """\
#include <execinfo.h>
#include <cstdint>
extern "C" {
int frames = 0;
void* stack[32];
void rtcf_log_Regler_0(std::int64_t, double) { frames = backtrace(stack, 32); }
// An input that nobody has written, and an output, as port.hpp has them.
std::int64_t slot[3] = {}, time_base[5] = {};
void* input[4] = {slot, slot};
void* output[4] = {slot, time_base};
void* ports[2] = {input, output};
}
"""


def run(*command: str | Path, **environment: str) -> str:
    done = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, check=False,
        timeout=DEADLINE_S, env=os.environ | {"LC_ALL": "C.UTF-8"} | environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A component, and a module next to it."""
    return written(tmp_path_factory.mktemp("ordner_ü"))


def written(folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "teile_ü.py").write_text(MODULE)
    file = folder / "regler.py"
    file.write_text(SOURCE)
    return file


@pytest.fixture(scope="module")
def library(source: Path) -> Path:
    made = source.with_name("regler.so")
    run(COMMAND, source, "-o", made)
    return made


def line(text: str, source: str = SOURCE) -> int:
    return 1 + next(i for i, each in enumerate(source.splitlines()) if text in each)


def places(library: Path, function: str) -> str:
    """Return addr2line's output for all instructions of a function, with inlined functions."""
    listing = run("objdump", "-d", f"--disassemble={function}", library)
    addresses = re.findall(r"^ +([0-9a-f]+):\t", listing, re.M)
    assert addresses
    return run("addr2line", "-f", "-i", "-p", "-e", library, *addresses)


def test_each_instruction_belongs_to_a_source_line(source: Path, library: Path) -> None:
    found = places(library, "rtcf_Regler_update")
    named = set(re.findall(r"(\S+) at (\S+):(\d+)$", re.sub(r" \(discr.*", "", found), re.M))
    functions = {(name, file) for name, file, _ in named}
    assert functions == {
        ("Regler.update", str(source)),
        ("Base.update", str(source)),
        ("Base.scaled", str(source)),
        ("größe", str(source.with_name("teile_ü.py"))),
    }
    lines = {int(number) for name, _, number in named if name == "Regler.update"}
    assert lines >= {line("super().up"), line("größe(self"), line("sin("), line("self.info")}
    assert lines <= set(range(line("super().up") - 1, line("self.info") + 1))
    assert {int(number) for name, _, number in named if name == "größe"} <= {2, 3}
    inlined = r"größe at .*/teile_ü\.py:2\n \(inlined by\) Regler\.update at .*regler\.py:{}\n"
    assert re.search(inlined.format(line("größe(self")), found), found


def test_a_crash_is_reported_with_its_line(library: Path) -> None:
    (told,) = find(trace_of(library, str(library), ("rtcf_Regler_start",)), library).lines
    assert told == f"Regler.start at regler.py:{line('self.total = 3.0')}"


def test_gdb_stops_at_source_lines(source: Path, library: Path) -> None:
    number = line("größe(self")
    found = run(
        "gdb", "-nx", "-q", "-batch",
        "-ex", "set breakpoint pending on", "-ex", "set debuginfod enabled off",
        "-ex", f"break regler.py:{number}", "-ex", "break Base.scaled",
        "-ex", "run", "-ex", "backtrace", "-ex", f"info line regler.py:{number}", "-ex", "list",
        "-ex", "continue", "-ex", "backtrace",
        "--args", EXECUTOR, "--check", library, "--package", "p", "--type", "Regler",
        "--cycles", "3",
    )  # fmt: skip
    assert re.search(rf"^#0 .*Regler\.update \(\) at {source}:{number}$", found, re.M), found
    assert re.search(r"^#\d+ .*PythonComponent::update", found, re.M), found
    assert f'Line {number} of "{source}" starts at address' in found
    assert f"{number}\t        self.total += größe(self.u.value, self.total)" in found
    assert re.search(rf"^#0  Base\.scaled \(\) at {source}:{line('self.gain *')}$", found, re.M)
    outer = rf"^#1 .*Regler\.update \(\) at {source}:{line('sin(')}$"
    assert re.search(outer, found, re.M), found


def test_a_stack_trace_includes_the_component(source: Path, tmp_path: Path) -> None:
    cls = modules.components(modules.load(source))[-1]
    files = [tmp_path / f"{i}.o" for i in range(2)]
    compiled = object_file.compile_component(cls)
    for file, content in zip(files, compiled.objects, strict=True):
        file.write_bytes(content)
    (tmp_path / "logged.cpp").write_text(LOGGED)
    library = tmp_path / "logged.so"
    run("g++", "-shared", "-fPIC", tmp_path / "logged.cpp", *files, "-lm", "-o", library)
    loaded = ctypes.CDLL(str(library))
    record = ctypes.create_string_buffer(4096)
    assert loaded.rtcf_Regler_update(record, (ctypes.c_void_p * 2).in_dll(loaded, "ports")) == 0
    count = ctypes.c_int.in_dll(loaded, "frames").value
    stack = (ctypes.c_void_p * 32).in_dll(loaded, "stack")
    base = ctypes.cast(loaded.rtcf_Regler_update, ctypes.c_void_p).value or 0
    (symbol,) = re.findall(r"^([0-9a-f]+) T rtcf_Regler_update$", run("nm", library), re.M)
    base -= int(symbol, 16)
    assert count > 3, "the stack ends in the component"
    told = run("addr2line", "-f", "-p", "-e", library, hex((stack[1] or 0) - 1 - base))
    assert told == f"Regler.update at {source}:{line('self.info')}\n"


def test_the_machine_code_is_the_same_as_without_lines(source: Path, tmp_path: Path) -> None:
    cls = modules.components(modules.load(source))[-1]

    def listings() -> list[str]:
        found = []
        for content in object_file.compile_component(cls).objects:
            (tmp_path / "one.o").write_bytes(content)
            found.append(run("objdump", "-d", "-r", tmp_path / "one.o"))
        return found

    with_lines = listings()
    with (
        mock.patch.object(source_lines, "emitted", contextlib.nullcontext),
        mock.patch.object(source_lines, "unwound", lambda assembly: assembly),
    ):
        assert listings() == with_lines


def test_a_library_can_be_stripped(library: Path, tmp_path: Path) -> None:
    stripped, debug = tmp_path / "regler.so", tmp_path / "regler.debug"
    run("objcopy", "--only-keep-debug", "--compress-debug-sections", library, debug)
    run("strip", "--strip-unneeded", "-o", stripped, library)
    assert b"Regler.update" not in stripped.read_bytes()
    run(EXECUTOR, "--check", stripped, "--package", "p", "--type", "Regler", "--cycles", "3")
    run("objcopy", f"--add-gnu-debuglink={debug}", stripped)
    (told,) = find(trace_of(library, str(stripped), ("rtcf_Regler_start",)), stripped).lines
    assert told == f"Regler.start at regler.py:{line('self.total = 3.0')}"


def test_libraries_do_not_contain_their_build_folder(tmp_path: Path) -> None:
    contents = []
    for folder in (tmp_path / "one", tmp_path / "other_folder"):
        source = written(folder)
        flags = f"-O2 -ffile-prefix-map={folder}=."
        run(COMMAND, source, "-o", folder / "lib.so", CXXFLAGS=flags)
        contents.append((folder / "lib.so").read_bytes())
        assert str(folder).encode() not in contents[-1]
        found = places(folder / "lib.so", "rtcf_Regler_update")
        assert re.search(r"^Regler\.update at (\./)*regler\.py:\d+$", found, re.M), found
    assert contents[0] == contents[1]


def test_lines_of_faults_are_correct_with_mapped_paths(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "faulty.py"
    source.write_text(
        "from rtcf.component import Component, Input\n\n\nclass Faulty(Component):\n"
        "    u: Input[float]\n\n    def update(self):\n        if self.u.value > 1.0:\n"
        '            raise ValueError("too much")\n'
    )
    (cls,) = modules.components(modules.load(source))

    def faults() -> set[tuple[str, int, str]]:
        raises = object_file.compile_component(cls).raises.values()
        return {(each.file, each.line, each.text) for each in raises}

    plain = faults()
    assert plain == {(str(source), 9, "ValueError: too much")}
    monkeypatch.setenv("CXXFLAGS", f"-g -ffile-prefix-map={tmp_path}=/usr/src/regler")
    assert faults() == plain


def test_two_bases_of_the_same_name_have_distinct_lines(tmp_path: Path) -> None:
    declared = "(Component):\n    n: State[float]\n    out: Output[float]\n\n"
    imported = "from rtcf.component import Component, Output, State\n"
    (tmp_path / "older.py").write_text(
        f"{imported}\n\nclass Base{declared}    def update(self):\n"
        "        self.n = self.n * 0.5 + 1.0\n"
    )
    source = tmp_path / "newer.py"
    source.write_text(
        f"{imported}from older import Base as Old\n\n\nclass Base(Old):\n    def update(self):\n"
        "        super().update()\n        self.out.write(self.n)\n"
    )
    run(COMMAND, source, "-o", tmp_path / "lib.so")
    found = places(tmp_path / "lib.so", "rtcf_Base_update")
    assert re.search(
        r"Base.update at .*/older.py:9\n \(inlined by\) Base.update at .*/newer.py:7\n", found
    ), found
    assert re.search(r"^Base.update at .*/newer.py:8$", found, re.M), found
