"""The drawings in README and docs are up to date."""

import re
import subprocess
from pathlib import Path

import pytest
from pages import TREE

NUMBER = r"-?\d+(?:\.\d+)?"


def test_the_drawing_of_the_arm_is_as_its_tool_draws_it(tmp_path: Path) -> None:
    subprocess.run([TREE / "tools" / "draw-arm", tmp_path / "arm.svg"], check=True, timeout=60)
    drawn, kept = (
        (folder / "arm.svg").read_text() for folder in (tmp_path, TREE / "docs" / "images")
    )
    assert re.sub(NUMBER, "N", drawn) == re.sub(NUMBER, "N", kept), "run tools/draw-arm"
    # The last digit may be rounded differently.
    numbers = [[float(each) for each in re.findall(NUMBER, text)] for text in (drawn, kept)]
    assert numbers[0] == pytest.approx(numbers[1], abs=0.11)
