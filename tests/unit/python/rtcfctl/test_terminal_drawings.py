"""Numbers drawn with characters."""

import math

from hypothesis import given
from hypothesis import strategies as st
from rtcfctl.terminal.drawings import Curves, drawn, spark


def test_a_row_of_blocks_begins_at_zero() -> None:
    assert spark([0, 1, 2, 7], 10) == "▁▂▃█"
    assert spark([5, 5, 5], 2) == "██"
    assert spark([0, 0], 5) == "▁▁"
    assert spark([1, math.nan, 1], 5) == "█ █"
    assert spark([], 5) == ""


def test_the_corners_of_a_plot_are_its_ends() -> None:
    curves = Curves(2, 2, -1.0, 1.0)
    curves.column(0, -1.0, -1.0, 0)
    curves.column(3, 1.0, 1.0, 1)
    assert curves.lines() == [[(" ", -1), ("\u2808", 1)], [("\u2840", 0), (" ", -1)]]


def test_a_number_that_rounds_to_zero_has_no_sign() -> None:
    _, *lines, _ = drawn("", [[-0.004, 1.0]], {})
    assert lines[0].split()[0] == "1.00"
    assert lines[-1].split()[0] == "0.00"


def test_a_column_is_a_line_of_dots() -> None:
    curves = Curves(1, 2, 0.0, 1.0)
    curves.column(0, 0.0, 1.0, 0)
    assert curves.lines() == [[("\u2847", 0)], [("\u2847", 0)]]


@given(
    st.lists(st.tuples(st.floats(), st.floats()), max_size=20),
    st.floats(allow_nan=False, allow_infinity=False, min_value=-1e300, max_value=1e300),
)
def test_any_numbers_can_be_drawn(ends: list[tuple[float, float]], low: float) -> None:
    curves = Curves(10, 3, low, low)
    for x, (one, other) in enumerate(ends):
        curves.column(x, one, other, 0)
    for line in curves.lines():
        assert sum(len(text) for text, _ in line) == 10
