"""Random programs give the same results compiled and interpreted, bit by bit except for the last
places of functions of the C library and NumPy.
"""

import os
import random
from pathlib import Path

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from programs import Program, module
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules

TOGETHER = 25  # programs per component
TIMES = 12  # runs of each program, on average


def same(seed: int, folder: Path) -> None:
    """Compile the programs of a seed and run them both ways."""
    draw = random.Random(seed)
    file = folder / f"programs_{seed}.py"
    file.write_text(module({number: Program(draw) for number in range(TOGETHER)}))
    (cls,) = modules.components(modules.load(file))
    found = verify.compare(cls, object_file.compile_component(cls), TOGETHER * TIMES, seed)
    assert found.cycles == TOGETHER * TIMES
    assert found.differences == [], f"seed {seed}: {found}"


# A seed cannot be shrunk.
@settings(max_examples=3, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(seed=st.integers(0, 2**32 - 1))
def test_random_programs_give_the_same_results_compiled_and_interpreted(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    same(seed, tmp_path_factory.mktemp("programs"))


@pytest.mark.long
def test_a_hundred_thousand_random_programs(tmp_path: Path) -> None:
    begin = int(os.environ.get("RTCF_SEED", "26"))
    for seed in range(begin, begin + 100_000 // TOGETHER):
        same(seed, tmp_path)
