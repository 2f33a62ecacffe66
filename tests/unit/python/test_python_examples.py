"""The examples of components in Python: each is accepted as it stands, and does compiled the same
as in the interpreter.
"""

from pathlib import Path

import pytest
from rtcf_compile.main import main

FOLDER = Path(__file__).parents[3] / "components" / "rtcf_examples" / "python"
EXAMPLES = sorted(each.stem for each in FOLDER.glob("*.py"))


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_does_the_same_compiled_and_in_the_interpreter(name: str) -> None:
    assert main([str(FOLDER / f"{name}.py"), "--verify", "400"]) == 0


@pytest.mark.long
@pytest.mark.parametrize("name", EXAMPLES)
def test_it_does_so_over_20000_cycles(name: str) -> None:
    assert main([str(FOLDER / f"{name}.py"), "--verify", "20000"]) == 0
