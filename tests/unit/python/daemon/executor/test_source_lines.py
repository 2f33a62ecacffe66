"""Source lines of a crash, from addresses and mappings of a real library."""

import subprocess
from pathlib import Path

import pytest
from crash_traces import find, trace_of
from rtcfd.executor.flight_recorder import Trace

CODE = """\
int inner(int value) {
    return 7 / value;
}
int outer(int value) { return inner(value) + 1; }
"""


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """A library with debug information."""
    source = tmp_path / "code.cpp"
    source.write_text(CODE)
    made = tmp_path / "my_code.so"
    command = ["g++", "-g", "-O0", "-shared", "-fPIC", str(source), "-o", str(made)]
    subprocess.run(command, check=True)
    return made


@pytest.mark.parametrize("mapped", ["{library}", "/memfd:my_code.so (deleted)"])
def test_frames_are_named_up_to_the_executor(library: Path, mapped: str) -> None:
    trace = trace_of(library, mapped.format(library=library), ("inner", "outer"))
    found = find(trace, library)
    assert found.lines == ("inner(int) at code.cpp:2", "outer(int) at code.cpp:4")
    assert found.place == found.lines[0]


def test_without_debug_information_the_function_is_named(library: Path) -> None:
    subprocess.run(["strip", "--strip-debug", str(library)], check=True)
    found = find(trace_of(library, str(library), ("inner",)), library)
    (line,) = found.lines
    assert line.startswith("inner(int) in my_code.so+0x")


def test_the_offset_is_named_for_a_replaced_file(library: Path, tmp_path: Path) -> None:
    # Not among the libraries that are unchanged since they were loaded.
    trace = trace_of(library, "/memfd:my_code.so (deleted)", ("inner",))
    assert find(trace).place.startswith("my_code.so+0x")
    # It is also unknown which of two libraries it was.
    other = tmp_path / "other" / "my_code.so"
    other.parent.mkdir()
    other.write_bytes(library.read_bytes())
    assert find(trace, library, other).place.startswith("my_code.so+0x")


@pytest.mark.parametrize("damage", [b"", b"\x7fELF", b"\x7fELF\x02\x01" + b"\xff" * 100])
def test_the_offset_is_named_for_a_file_that_is_no_library(library: Path, damage: bytes) -> None:
    trace = trace_of(library, str(library), ("inner",))
    library.write_bytes(damage)
    assert find(trace, library).place.startswith("my_code.so+0x")


def test_a_jump_to_an_unmapped_address_is_reported(library: Path) -> None:
    trace = trace_of(library, str(library), ("outer",))
    found = find(Trace((0, *trace.frames), trace.maps), library)
    assert found.lines == ("no code at 0x0", "outer(int) at code.cpp:4")
    assert found.place == "outer(int) at code.cpp:4"


def test_invalid_mappings_are_skipped() -> None:
    assert find(Trace((1, 2, 3), "nonsense\n\n1-2 r-xp\n")).lines == ("no code at 0x1",)
