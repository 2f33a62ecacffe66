"""Non-ASCII, similar and long names in Python components."""

import os
import subprocess
from pathlib import Path

import pytest
from daemon_process import BUILD_TREE
from rtcf.component import DeclarationError, Parameter
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import object_file
from rtcf_compile.machine_code.compiled import Compiled
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

COMMAND = BUILD_TREE / "bin" / "rtcf-compile"
DEADLINE_S = 600.0
WRITTEN_FREELY = """\
import enum

from größen import mal
from rtcf.component import Component, Derived, Input, Output, Parameter, State

Θ_MAX = 3.0


class Größenart(enum.IntEnum):
    LÄUFT = 1
    STEHT = 2


class Regler(Component):
    u: Input[float]
    x: Output[float] = Output(unit="°/s")
    kp: Parameter[float] = Parameter(1.0, unit="µm", doc="Verstärkung")
    mode: State[Größenart]
    Δ: Derived[float]
    total: State[float] = State(0.0, doc="Summe Σ")

    def prepare(self):
        self.Δ = 2.0 * self.kp

    def dämpfung(self, Δt, ß=1.0):
        return self.kp * Δt * ß

    def update(self):
        ü = self.dämpfung(self.dt, ß=2.0)
        self.mode = Größenart.LÄUFT if self.u.value > 0 else Größenart.STEHT
        self.info("größe {} läuft {}", ü, self.mode.name)
        self.debug("\\ud800")
        if self.u.value > 1e3:
            raise ValueError("zu groß: Ü")
        self.total += mal(ü, Θ_MAX) + self.Δ
        self.x.write(self.total)
"""
ALIKE = """\
from rtcf.component import Component, Output


class A_b(Component):
    def c(self):
        return 1.0

    def step(self):
        return 10.0


class Base(A_b):
    def step(self):
        return 100.0 + super().step()


Other = Base


class Base(Other):
    def step(self):
        return 1000.0 + Other.step(self)


class A(Base):
    out: Output[float]

    def b_c(self):
        return 2.0

    def update(self):
        self.out.write(self.c() + self.b_c() + self.step() + Other.step(self))


class A_update(Component):
    out: Output[float]

    def update(self):
        self.out.write(7.0)


class log_A(Component):
    out: Output[float]

    def update(self):
        self.info("{}", 1)
        self.out.write(8.0)
"""
DECLARING = """\
from rtcf.component import Component, Input, Output, Parameter, State


class {name}(Component):
    x: Output[float]
    {declared}

    def update(self):
        self.x.write(1.0)
"""


def compiled(file: Path) -> list[Compiled]:
    return [object_file.compile_component(each) for each in modules.components(modules.load(file))]


def written(tmp_path: Path, source: str, name: str = "source") -> Path:
    file = tmp_path / f"{name}.py"
    file.write_text(source)
    return file


def compile_to(library: Path, file: Path) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [str(COMMAND), str(file), "-o", str(library)],
        capture_output=True, text=True, check=False, timeout=DEADLINE_S,
    )  # fmt: skip


def test_names_invisible_to_ros_can_have_any_letters(tmp_path: Path) -> None:
    (tmp_path / "größen.py").write_text("def mal(ä, Δ):\n    return ä * Δ\n")
    file = written(tmp_path, WRITTEN_FREELY, "θ-регулятор")
    (cls,) = modules.components(modules.load(file))
    (machine_code,) = compiled(file)
    found = verify.compare(cls, machine_code, 300, 1)
    assert found.differences == [] and found.raised > 0
    texts = {each.text for each in machine_code.raises.values()}
    assert "ValueError: zu groß: Ü" in texts
    done = compile_to(tmp_path / "ü" / "größe.so", file)
    assert done.returncode == 0, done.stderr
    data = (tmp_path / "ü" / "größe.so").read_bytes()
    for text in ("größe {} läuft LÄUFT", "µm", "°/s", "Verstärkung", "Summe Σ", "θ-регулятор.py"):
        assert text.encode() in data, text


GROUPS = """\
import numpy as np
from rtcf.component import Component, Parameter, State


class Grouped(Component):
    p: Parameter[float] = Parameter(1.0, name="gains/p")
    k: Parameter[np.float64, 2] = Parameter([2.0, 3.0], name="gains/k")
    {declared}

    def update(self):
        self.info("{{}}", self.p + self.k[1])
"""


def test_parameters_have_names_in_groups(tmp_path: Path) -> None:
    file = written(tmp_path, GROUPS.format(declared="gains_p: Parameter[int] = 4"))
    (machine_code,) = compiled(file)
    names = [each.elements for each in machine_code.description.of(Parameter)]
    assert names == [["gains/p"], ["gains/k_0", "gains/k_1"], ["gains_p"]]


@pytest.mark.parametrize(
    ("declared", "mistake"),
    [
        ('d: Parameter[float] = Parameter(1.0, name="gains/")', "has name='gains/': use names"),
        ('d: Parameter[float] = Parameter(1.0, name="µ/p")', "has name='µ/p': use names"),
        ("d: Parameter[float] = Parameter(1.0, name=3)", "has name=3: use names"),
        ('d: Parameter[float] = Parameter(1.0, name="gains/p")', "and p both have a parameter"),
        (
            "gains: Parameter[float] = 1.0",
            "makes gains a group, which is also a parameter (of gains)",
        ),
        (
            'd: Parameter[float] = Parameter(1.0, name="gains/k_1/low")',
            "makes gains/k_1 a group, which is also a parameter (of k): rename one",
        ),
        ('d: State[float] = State(1.0, name="gains/d")', "has no option 'name'"),
    ],
)
def test_an_invalid_group_is_rejected(tmp_path: Path, declared: str, mistake: str) -> None:
    file = written(tmp_path, GROUPS.format(declared=declared))
    with pytest.raises((DeclarationError, Mistake)) as refused:
        compiled(file)
    assert mistake in str(refused.value)


@pytest.mark.parametrize(
    ("declared", "name", "advice"),
    [
        ("θ: State[float]", "θ", "write theta"),
        ("Größe: Input[float]", "Größe", "write Grosse"),
        ("Δt: Output[float]", "Δt", "write Deltat"),
        ("é_1: Parameter[float] = Parameter(1.0)", "é_1", "write e_1"),
        ("速度: State[float]", "速度", "take another name"),
        # The micro sign, which Python normalises to the Greek letter.
        ("\u00b5: State[float]", "\u03bc", "write mu"),
    ],
)
def test_a_name_invalid_in_ros_is_rejected_with_a_suggestion(
    tmp_path: Path, declared: str, name: str, advice: str
) -> None:
    file = written(tmp_path, DECLARING.format(name="Plain", declared=declared))
    what = f"{file}:6: `{declared}`: Plain.{name} is not a valid name in ROS (ASCII letters only)"
    what += f": {advice}"
    with pytest.raises(DeclarationError) as refused:
        compiled(file)
    assert str(refused.value) == what
    done = compile_to(tmp_path / "lib.so", file)
    assert (done.returncode, done.stderr) == (1, f"rtcf-compile: {what}\n")


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("Größe", "Größe is not a valid name in ROS (ASCII letters only): write Grosse"),
        ("R" * 100, "has 100 characters: choose a name of at most 64"),
    ],
)
def test_a_class_name_that_rtcfd_rejects_is_rejected(tmp_path: Path, name: str, what: str) -> None:
    file = written(tmp_path, DECLARING.format(name=name, declared="u: Input[float]"))
    with pytest.raises(Mistake) as refused:
        compiled(file)
    assert str(refused.value).startswith(f"{file}:4: ")
    assert str(refused.value).endswith(what)


def test_a_class_with_an_underscore_is_a_base(tmp_path: Path) -> None:
    source = DECLARING.format(name="_Basis_für_alle", declared="u: Input[float]")
    source += "\n\nclass Plain(_Basis_für_alle):\n    def update(self):\n        super().update()\n"
    assert [each.description.name for each in compiled(written(tmp_path, source))] == ["Plain"]


def test_names_may_have_100_characters(tmp_path: Path) -> None:
    names = [f"{each * 99}{digit}" for each in "pq" for digit in (1, 2)]
    state, other, method, function = names
    source = (
        f"from rtcf.component import Component, Output, State\n\n\ndef {function}({other}):\n"
        f"    return 2.0 * {other}\n\n\nclass {'R' * 64}(Component):\n    {state}: State[float]\n"
        f"    {other}: Output[float]\n\n    def {method}(self, {state}):\n"
        f"        return {state} + 1.0\n\n    def update(self):\n"
        f"        self.{state} = {function}(self.{method}(self.{state}))\n"
        f"        self.{other}.write(self.{state} % 7.0)\n"
    )
    file = written(tmp_path, source, "f" * 100)
    (cls,) = modules.components(modules.load(file))
    (machine_code,) = compiled(file)
    assert verify.compare(cls, machine_code, 20, 1).differences == []
    assert compile_to(tmp_path / "lib.so", file).stderr == ""


def test_similar_names_of_classes_and_methods_do_not_collide(tmp_path: Path) -> None:
    file = written(tmp_path, ALIKE)
    classes = modules.components(modules.load(file))
    assert [each.__name__ for each in classes] == ["A", "A_update", "log_A"]
    for cls in classes:
        found = verify.compare(cls, object_file.compile_component(cls), 3, 1)
        assert found.differences == []
    assert compile_to(tmp_path / "lib.so", file).stderr == ""


def test_a_file_name_that_is_not_utf_8_is_rejected_in_one_line(tmp_path: Path) -> None:
    file = Path(os.fsdecode(os.fsencode(tmp_path) + b"/gr\xf6sse.py"))
    file.write_text(DECLARING.format(name="Plain", declared="u: Input[float]"))
    done = compile_to(tmp_path / "lib.so", file)
    assert done.returncode == 1
    assert done.stderr.endswith("sse.py: its path is not UTF-8: rename the file\n")
    assert done.stderr.count("\n") == 1
