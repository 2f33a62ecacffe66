"""Compiled components match the interpreter to the last places; differences are found."""

import os
import re
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from daemon_process import BUILD_TREE
from pages import TREE
from rtcf_compile import main
from rtcf_compile.comparison import inside, model, verify, watched
from rtcf_compile.machine_code import object_file
from rtcf_compile.machine_code.compiled import Compiled
from rtcf_compile.rewriting.functions import HELPERS
from rtcf_compile.source import modules as source

FOLDER = TREE / "tests" / "components" / "python"
NAMES = ("controllers", "filters", "messages", "written")
FILES = [source.load(FOLDER / f"{name}.py") for name in NAMES]
# One branch of Failing fills the arena, which the interpreter does not have.
CLASSES = {
    each.__name__: each
    for file in FILES
    for each in source.components(file)
    if each.__name__ != "Failing"
}


@pytest.fixture(scope="module")
def compiled() -> dict[str, Compiled]:
    """Cache compiled components."""
    return {}


def compared(name: str, compiled: dict[str, Compiled], cycles: int) -> verify.Comparison:
    if name not in compiled:
        compiled[name] = object_file.compile_component(CLASSES[name])
    return verify.compare(CLASSES[name], compiled[name], cycles)


@pytest.mark.parametrize("name", CLASSES)
def test_machine_code_and_interpreter_agree(name: str, compiled: dict[str, Compiled]) -> None:
    found = compared(name, compiled, 3_000)
    assert found.differences == [] and found.problem == ""
    assert found.cycles == 3_000
    assert (found.raised > 0) == (name == "Raiser")


@pytest.mark.long
@pytest.mark.parametrize("name", CLASSES)
def test_they_agree_over_a_million_cycles(name: str, compiled: dict[str, Compiled]) -> None:
    assert compared(name, compiled, 1_000_000).differences == []


COMPONENT = """\
import numpy as np
from rtcf.component import Component, Input, Output, Parameter


class {name}(Component):
    a: Input[{a}]
    gain: Parameter[float] = Parameter(1.0, min=0.5, max=2.0)
    out: Output[{out}]

{body}
"""
# Python's ints are unbounded, the loop's have 64 bits.
OVERFLOW = "    def update(self):\n        self.out.write(self.a.value * 10**18 % 7)"
# Python continues to 2**64, which is 0 in 64 bits.
ENDLESS_COMPILED = """\
    def update(self):
        x = self.a.value * 0 + 2**32
        while x * x < 2**62:
            x = x * 2
        self.out.write(x)
"""
WRAP = """\
    def update(self):
        x = self.a.value
        while x > np.pi:
            x -= 2 * np.pi
        self.out.write(x)
"""
# Compiled, an odd number times 2**64 is 0; the array divides to infinity in both.
DIVISIONS = """\
    def update(self):
        whole = (self.a.value * 2 + 1) * 2**32 * 2**32
        self.out.write(np.sum(1.0 / np.zeros(2)) + 1.0 / whole)
"""
ENDLESS_PREPARE = """\
    def prepare(self):
        x = self.gain
        while x != 3.0:
            x += 0.5

    def update(self):
        self.out.write(self.gain)
"""
SUM = "    def update(self):\n        self.out.write(np.sum(self.a.value))"


def written(folder: Path, body: str, a: str = "float", out: str = "", name: str = "Tried") -> str:
    """Write a component; return its file."""
    file = folder / f"{name.lower()}.py"
    file.write_text(COMPONENT.format(name=name, a=a, out=out or a, body=body.rstrip()))
    return str(file)


@pytest.mark.parametrize("amount", ["1000", "0.2s"])
def test_a_difference_is_reported_with_hook_cycle_member_and_both_values(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], amount: str
) -> None:
    library = tmp_path / "lib" / "tried.so"
    file = written(tmp_path, OVERFLOW, "int")
    assert main.main([file, "--verify", amount, "-o", str(library)]) == main.DIFFERENT
    said = capsys.readouterr()
    assert re.fullmatch(
        r"rtcf-compile: \S*tried\.py: Tried: update, cycle \d+: out is -?\d+ compiled, "
        r"-?\d+ in the interpreter\n",
        said.err,
    )
    assert "DIFFER; update, cycle" in said.out
    assert not library.exists()


def test_an_update_that_raises_in_every_cycle_is_rejected_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    library = tmp_path / "lib" / "tried.so"
    file = written(tmp_path, "    def update(self):\n        self.out.write(1.0 / (0 * self.gain))")
    assert main.main([file, "--verify", "300", "-o", str(library)]) == main.DIFFERENT
    said = capsys.readouterr()
    assert re.fullmatch(
        r"rtcf-compile: \S*tried\.py:11: `self\.out\.write\(.+\)`: Tried: update raises "
        r"in each of 300 cycles with random inputs: ZeroDivisionError: .+\n",
        said.err,
    ), said.err
    assert "300 raised in both: the same, BUT UPDATE ALWAYS RAISES" in said.out
    assert not library.exists()
    file = written(tmp_path, "    def update(self):\n        self.out.write(1.0 / int(self.gain))")
    assert main.main([file, "--verify", "3000"]) == main.DONE, "it raises only for some gains"


def test_ctrl_c_ends_it_silently(tmp_path: Path) -> None:
    file = tmp_path / "tried.py"
    file.write_text("import os, signal\n\nos.kill(os.getpid(), signal.SIGINT)\n")
    done = subprocess.run(
        [str(BUILD_TREE / "bin" / "rtcf-compile"), str(file), "--verify"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (main.INTERRUPTED, "", "")


def test_a_division_by_zero_only_in_machine_code_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, DIVISIONS, "int", "float")
    assert main.main([file, "--verify", "100"]) == main.DIFFERENT
    said = capsys.readouterr().err
    assert "ZeroDivisionError: division by zero compiled, no fault in the interpreter" in said


def test_another_fault_is_a_difference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = written(tmp_path, "    def update(self):\n        self.out.write(1.0 / 0.0)")
    monkeypatch.setattr(inside.Inside, "call", lambda *_: "9: IndexError: index 3")
    assert main.main([file, "--verify", "1"]) == main.DIFFERENT
    assert re.search(
        r"IndexError: index 3 compiled, ZeroDivisionError: .* in the interpreter",
        capsys.readouterr().err,
    )


def test_numpy_scalars_divide_as_in_compiled_code(tmp_path: Path) -> None:
    body = """\
    def update(self):
        v = self.a.value
        x = v[0] / (v[1] - v[1]) if v[0] > 0.0 else 1.0
        y = v[0] % v[3] + v[0] // v[2]
        y /= v[1]
        y //= v[2]
        y %= v[3]
        v = v / 0.0
        k = 7
        k //= 1 - int(x > 100.0)
        self.out.write(x + y + k + divmod(y, x)[1])
"""
    file = written(tmp_path, body, "np.float64, 4", "float")
    assert main.main([file, "--verify", "2000"]) == main.DONE


def test_a_differing_element_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = """\
    def update(self):
        pair = np.zeros(2, np.int64)
        pair[1] = self.a.value * 10**18 % 7
        self.out.write(pair)
"""
    file = written(tmp_path, body, "int", "np.int64, 2")
    assert main.main([file, "--verify", "100"]) == main.DIFFERENT
    assert "out[1] is " in capsys.readouterr().err


def test_different_rounding_of_a_sum_is_no_difference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # In another order than in compiled code.
    backwards = {name: lambda a, *_: np.sum(a[::-1]) for name in HELPERS if "sum" in name}
    monkeypatch.setattr(model, "HELPERS", HELPERS | backwards)
    assert main.main([written(tmp_path, SUM, "np.float64, 64", "float"), "--verify", "1000"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"1000 cycles, .*[1-9]\d* explained by rounding: the same", said)


def test_an_error_larger_than_rounding_is_a_difference() -> None:
    nearby = [np.float64(1.0) + each for each in (1e-16, -2e-16)]
    assert verify._is_rounding(np.float64(1.0 + 2e-15), np.float64(1.0), nearby)
    assert not verify._is_rounding(np.float64(1.0 + 1e-14), np.float64(1.0), nearby)
    assert not verify._is_rounding(np.float64("nan"), np.float64(1.0), nearby)
    assert not verify._is_rounding(np.float64(2.0), np.float64(1.0), [])


def test_an_infinite_element_does_not_hide_other_differences() -> None:
    theirs = np.array([1.0, np.inf, np.nan, 5.0])
    nearby = [np.array([1.0 + 4e-16, np.inf, np.nan, 5.0]), theirs]
    assert verify._is_rounding(theirs + np.array([2e-15, 0.0, 0.0, 1e-15]), theirs, nearby)
    assert not verify._is_rounding(theirs + np.array([2e-15, 0.0, 0.0, 1e-13]), theirs, nearby)
    assert not verify._is_rounding(theirs + np.array([1e-14, 0.0, 0.0, 0.0]), theirs, nearby)
    assert not verify._is_rounding(np.array([1.0, 7.0, np.nan, 5.0]), theirs, nearby)


@pytest.mark.parametrize("value", ["self.a.value * 0.1", "np.std(self.a.value)", "SMOOTHED"])
def test_float32_is_rounded_as_in_numpy(
    value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    body = f"    def update(self):\n        self.out.write({value} * np.ones(8))"
    if value == "SMOOTHED":
        body = """\
    def update(self):
        z = np.zeros(8, np.float32)
        for _ in range(50):
            z[:] = 1.9 * z - 0.95 * z + 0.1 * self.a.value
        self.out.write(z)"""
    file = written(tmp_path, body, "np.float32, 8", "np.float64, 8")
    assert main.main([file, "--verify", "3000"]) == main.DONE
    assert "cycles, 0 ulp: the same" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("body", "kind", "said"),
    [
        (
            WRAP,
            "float",
            r":12: `while x > np\.pi:`: Tried: update, cycle \d+: it did not end within 2 s of "
            r"processor time in the interpreter with a = \S+: bound its loops: .*",
        ),
        (
            ENDLESS_PREPARE,
            "float",
            r":12: `while x != 3\.0:`: Tried: prepare, cycle \d+: it did not end within 2 s of "
            r"processor time in the interpreter: bound its loops: .*",
        ),
        (
            ENDLESS_COMPILED,
            "int",
            r":?.*: Tried: update, cycle 0: it did not end within 2 s of processor time compiled: "
            r"bound its loops: .*",
        ),
    ],
    ids=["interpreter", "prepare", "compiled"],
)
def test_an_endless_hook_is_reported_with_its_loop(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], body: str, kind: str, said: str
) -> None:
    assert main.main([written(tmp_path, body, kind), "--verify", "1000"]) == main.DIFFERENT
    assert re.fullmatch(rf"rtcf-compile: \S*tried\.py{said}\n", capsys.readouterr().err)


def test_an_endless_loop_does_not_block_compiling(tmp_path: Path) -> None:
    # Compiling runs some cycles in the interpreter, too.
    (tried,) = source.components(source.load(Path(written(tmp_path, ENDLESS_PREPARE))))
    assert object_file.compile_component(tried).hooks == ["prepare", "update"]


def test_seconds_are_processor_time_after_the_minimum_of_cycles(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = 5.0
    monkeypatch.setattr(time, "process_time", lambda: now)
    enough = watched.Amount.parse("1s").enough(components=2)
    assert not enough(10**9)
    now = 5.5
    assert enough(50) and not enough(49)


@pytest.mark.parametrize("amount", ["0", "-3", "1.5", "0s", "0.0s", "s", "1m", "1e9"])
def test_an_invalid_amount_is_rejected(capsys: pytest.CaptureFixture[str], amount: str) -> None:
    with pytest.raises(SystemExit):
        main.main(["none.py", f"--verify={amount}"])
    said = f"--verify {amount}: give cycles (10000) or seconds (1s)"
    assert said in capsys.readouterr().err


def test_a_crash_of_compiled_code_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def die(self: inside.Inside, hook: str, record: Any) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    monkeypatch.setattr(inside.Inside, "call", die)
    ramp = object_file.compile_component(CLASSES["Ramp"])
    (found,) = watched.compare_all([CLASSES["Ramp"]], [ramp], watched.Amount(cycles=10))
    assert found.differences == ["update, cycle 0: SIGKILL compiled, none in the interpreter"]


def test_a_distance_counts_representable_numbers() -> None:
    one = np.float64(1.0)
    assert verify.ulp(one, np.nextafter(one, 2.0)) == 1
    assert verify.ulp(np.float64(0.0), np.float64(-0.0)) == 0
    assert verify.ulp(np.float64(5e-324), np.float64(-5e-324)) == 2
    assert verify.ulp(np.float64("nan"), np.float64("nan")) == 0
    assert verify.ulp(np.float64("nan"), one) > verify.LARGEST_ULP
    assert verify.ulp(np.array([1.0, 2.0]), np.array([1.0, 3.0])) > verify.LARGEST_ULP
