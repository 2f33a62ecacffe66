"""Compiled components do what the interpreter does, to the last places; what does not is found."""

from pathlib import Path

import numpy as np
import pytest
from rtcf_compile import main
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import lowering
from rtcf_compile.source import modules as source

FOLDER = Path(__file__).parents[2] / "components" / "python"
FILES = [source.load(FOLDER / f"{name}.py") for name in ("controllers", "filters", "messages")]
# One way of Failing fills the arena, which the interpreter does not have.
CLASSES = {
    each.__name__: each
    for file in FILES
    for each in source.components(file)
    if each.__name__ != "Failing"
}


@pytest.fixture(scope="module")
def compiled() -> dict[str, lowering.Compiled]:
    """Keep what has been compiled."""
    return {}


def compared(name: str, compiled: dict[str, lowering.Compiled], cycles: int) -> verify.Comparison:
    if name not in compiled:
        compiled[name] = lowering.compile_component(CLASSES[name])
    return verify.compare(CLASSES[name], compiled[name], cycles)


@pytest.mark.parametrize("name", CLASSES)
def test_machine_code_and_interpreter_agree(
    name: str, compiled: dict[str, lowering.Compiled]
) -> None:
    found = compared(name, compiled, 10_000)
    assert found.differences == []
    assert found.cycles == 10_000
    assert (found.raised > 0) == (name == "Raiser")


@pytest.mark.long
@pytest.mark.parametrize("name", CLASSES)
def test_they_agree_over_a_million_cycles(
    name: str, compiled: dict[str, lowering.Compiled]
) -> None:
    assert compared(name, compiled, 1_000_000).differences == []


DIFFERENT = """\
import numpy as np
from rtcf.component import Component, Input, Output


class Sums(Component):
    a: Input[np.float64, 64]
    out: Output[float]

    def update(self):
        self.out.write(np.sum(self.a.value))
"""


def test_a_difference_is_told_with_the_cycle_and_both_values(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "sums.py"
    file.write_text(DIFFERENT)
    assert main.main([str(file), "--verify", "1000"]) == 1
    said = capsys.readouterr().out
    assert "DIFFER; cycle" in said
    assert "in the interpreter" in said and "compiled (" in said


def test_a_distance_counts_representable_numbers() -> None:
    one = np.float64(1.0)
    assert verify.ulp(one, np.nextafter(one, 2.0)) == 1
    assert verify.ulp(np.float64(0.0), np.float64(-0.0)) == 0
    assert verify.ulp(np.float64(5e-324), np.float64(-5e-324)) == 2
    assert verify.ulp(np.float64("nan"), np.float64("nan")) == 0
    assert verify.ulp(np.float64("nan"), one) > verify.LARGEST_ULP
    assert verify.ulp(np.array([1.0, 2.0]), np.array([1.0, 3.0])) > verify.LARGEST_ULP
