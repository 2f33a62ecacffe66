"""Random programs give the same results compiled and interpreted, bit by bit except for the last
places of functions of the C library and NumPy.
"""

import os
import random
from pathlib import Path
from typing import Any

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from programs import Program, module
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

TOGETHER = 25  # programs per component
TIMES = 12  # runs of each program, on average


def compiled(programs: dict[int, Program], file: Path) -> tuple[Any, Any]:
    """Return a component with these programs and its machine code; remove a rejected program."""
    while True:
        file.write_text(module(programs))
        (cls,) = modules.components(modules.load(file))
        try:
            return cls, object_file.compile_component(cls)
        except Mistake as mistake:
            # The only reason to reject: an int that a loop may double in each iteration.
            assert "which has 53 bits" in mistake.what, f"{file}: {mistake}"
            before = "\n".join(file.read_text().splitlines()[: mistake.line])
            del programs[int(before.rpartition("def program_")[2].partition("(")[0])]
            file = file.with_stem(f"{file.stem}_")  # modules are loaded once


def same(seed: int, folder: Path, together: int = TOGETHER) -> int:
    """Compile the programs of a seed and run them both ways. Return the number compiled."""
    draw = random.Random(seed)
    programs = {number: Program(draw) for number in range(together)}
    cls, code = compiled(programs, folder / f"programs_{seed}.py")
    assert len(programs) >= together - 2, f"seed {seed}: {together - len(programs)} rejected"
    found = verify.compare(cls, code, together * TIMES, seed)
    assert found.cycles == together * TIMES
    assert found.differences == [], f"seed {seed}: {found}"
    return len(programs)


# A seed cannot be shrunk.
@pytest.mark.random(8)
@settings(max_examples=9, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(seed=st.integers(0, 2**32 - 1))
def test_random_programs_give_the_same_results_compiled_and_interpreted(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    # Few programs an example, so that a share has several.
    same(seed, tmp_path_factory.mktemp("programs"), together=8)


@pytest.mark.long
def test_a_hundred_thousand_random_programs(tmp_path: Path) -> None:
    begin = int(os.environ.get("RTCF_SEED", "26"))
    for seed in range(begin, begin + 100_000 // TOGETHER):
        same(seed, tmp_path)
