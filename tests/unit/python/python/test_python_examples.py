"""The example components in Python: each is accepted unchanged, and gives the same results compiled
and interpreted.
"""

from pathlib import Path

import numpy as np
import pytest
from pages import TREE
from rtcf_compile.main import main
from rtcf_compile.rewriting import numpy_functions

EXAMPLES = sorted((TREE / "components").glob("*/python/*.py"))
EXAMPLES.append(TREE / "tests" / "bench" / "components" / "notch_bank.py")
NAMES = [each.stem for each in EXAMPLES]


@pytest.mark.parametrize("file", EXAMPLES, ids=NAMES)
def test_an_example_gives_the_same_results_compiled_and_interpreted(file: Path) -> None:
    assert main([str(file), "--verify", "400"]) == 0


@pytest.mark.long
@pytest.mark.parametrize("file", EXAMPLES, ids=NAMES)
def test_an_example_gives_the_same_results_over_20000_cycles(file: Path) -> None:
    assert main([str(file), "--verify", "20000"]) == 0


def test_functions_of_numpy_are_in_the_documentation() -> None:
    page = (TREE / "docs" / "python-components.md").read_text()
    libm = set(numpy_functions.LIBM) - {"exp", "log", "hypot"}
    aliases = {"ascontiguousarray", "amax", "amin", "around", "vdot", "matmul"}
    aliases |= {"round_", "trapezoid"}
    for function, _ in numpy_functions.STANDS_FOR:
        name = function.__name__
        is_numpy = name not in libm | aliases and getattr(np, name, None) is function
        assert not is_numpy or f"`{name}`" in page, name
