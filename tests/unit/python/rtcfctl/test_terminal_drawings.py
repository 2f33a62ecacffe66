"""Numbers drawn with characters."""

import math
import sys
from unittest import mock

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rtcfctl.terminal.drawings import Curves, bar, drawn, spark
from rtcfctl.terminal.safe_streams import in_ascii


def test_a_row_of_blocks_begins_at_zero() -> None:
    assert spark([0, 1, 2, 7], 10) == "▁▂▃█"
    assert spark([5, 5, 5], 2) == "██"
    assert spark([0, 0], 5) == "▁▁"
    assert spark([1, math.nan, 1], 5) == "█ █"
    assert spark([], 5) == ""


def test_drawings_in_ascii(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", mock.Mock(ascii=True))
    assert spark([0, 1, 7], 10) == ".:#"
    assert bar(0.5, 10) == "#####"
    lines = drawn("two curves", [[0.0, 0.0], [1.0, 1.0]], {1.0: "end"}, width=8, height=4)
    assert "".join(lines).isascii() and "*" in "".join(lines) and "+" in "".join(lines)


def test_marked_curves_differ_by_their_characters() -> None:
    curves = Curves(2, 2, -1.0, 1.0, marked=True)
    curves.column(0, -1.0, -1.0, 0)
    curves.column(3, 1.0, 1.0, 1)
    assert curves.lines() == [[(" ", -1), ("+", 1)], [("*", 0), (" ", -1)]]


@given(st.text())
def test_any_text_has_a_form_in_ascii(text: str) -> None:
    assert in_ascii(text).isascii()
    if text.isascii():
        assert in_ascii(text) == text


def test_ascii_keeps_what_a_text_says() -> None:
    assert in_ascii("30 µs … 5 °, x → y, ┌─┐│") == "30 us ~ 5  deg, x > y, +-+|"


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
