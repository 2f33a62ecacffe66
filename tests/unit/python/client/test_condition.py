"""Conditions on values of cycles: their meaning, and errors."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rtcf.streams.condition import Condition, ConditionError
from rtcf.v1 import ports_pb2
from rtcf_shared.ports import PortBatch, PortSchema, Signal


def over(text: str, **columns: list[float]) -> list[bool]:
    condition = Condition(text)
    by_name = {f"/{name.replace('_', '.')}": np.array(value) for name, value in columns.items()}
    values = [by_name[name] for name in condition.signals]
    return [bool(each) for each in condition.over(values, len(values[0]))]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a.x > 1", [False, False, True]),
        ("/a.x>=1", [False, True, True]),
        ("1 < a.x", [False, False, True]),
        ("0 < a.x < 2", [False, True, False]),
        ("a.x == 1 or b.y > 5", [False, True, True]),
        ("a.x == 1 && b.y > 5", [False, False, False]),
        ("not a.x > 0", [True, False, False]),
        ("abs(-a.x) > 1 and true", [False, False, True]),
        ("b.y/a.x == 3", [False, False, True]),
        ("b.y / /a.x == 3", [False, False, True]),
        ("max(a.x, b.y - 4) == 2", [False, False, True]),
        ("(a.x + 1) * 2 > 3.5e0", [False, True, True]),
        ("isnan(b.y)", [False, True, False]),
        ("b.y < inf", [True, False, True]),
        ("a.x != 2", [True, True, False]),
    ],
)
def test_a_condition_selects_the_expected_cycles(text: str, expected: list[bool]) -> None:
    assert over(text, a_x=[0.0, 1.0, 2.0], b_y=[1.0, math.nan, 6.0]) == expected


def test_a_bool_is_a_condition() -> None:
    assert over("a.x and not b.y", a_x=[True, True], b_y=[False, True]) == [True, False]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no condition"),
        ("a.x >", "is not a condition"),
        ("a.x > 1)", "is not a condition"),
        ("phase > 1", '"phase" in "phase > 1" is not a signal'),
        ("a.x + 1", "is a number: compare it"),
        ("1 > 0", "names no signal"),
        ("a.x > $", '"$" in'),
        ("a.x = 1", '"= 1" in'),
        ("abs(a.x, 1) > 1", "abs() takes 1 value"),
        ("max(a.x) > 1", "max() takes 2 values"),
        ("abs(a=a.x) > 1", "is not a signal"),
        ("abs > a.x", "abs is a function: write abs(…)"),
        ("inf(a.x) > 1", "the functions of a condition are abs, min, max, sqrt, isnan"),
        ("a.x(1) > 1", "the functions of a condition are"),
        ("-" * 900 + "a.x > 1", "parentheses"),
        ("a.x > __import__", "is not a signal"),
        ("a.x > 1" + " and a.x > 1" * 200, "at most 1000"),
        ("(" * 90 + "a.x > 1" + ")" * 90 + "> " + "-" * 100 + "1", "parentheses"),
    ],
)
def test_an_invalid_condition_is_rejected_in_one_line(text: str, said: str) -> None:
    with pytest.raises(ConditionError) as refused:
        over(text, a_x=[1.0])
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@given(st.text(max_size=60) | st.text("ab.x/()<>=!&|-+*,0123456789 []stae", max_size=40))
@example("0Ā\n")
@example("a.x\n+\r1")
def test_any_text_is_a_condition_or_rejected(text: str) -> None:
    try:
        condition = Condition(text)
        condition.over([np.array([1.0, math.nan])] * len(condition.signals), 2)
    except ConditionError as error:
        assert str(error).isprintable(), "line ends are escaped"


def test_signals_are_resolved_in_the_stream() -> None:
    signals = {
        "/a.v": Signal("/a.v", "", 0, "<f8", (3,), 0),
        "/a.m.p.x": Signal("/a.m.p.x", "", 1, "<f8", (), 0),
    }
    schema = PortSchema((), (), signals)
    Condition("a.v[2] > 0 and a.m.p.x > 0").check(schema)
    assert Condition("a.v[2] > 0 and a.m.p.x > 0").columns == ["/a.m", "/a.v"]
    for text, said in (
        ("a.v > 0", "is an array of 3: name one number, as in /a.v[0]"),
        ("a.v[3] > 0", "has 3 numbers, from [0]"),
        ("a.m > 0", "it has /a.m.p.x"),
        ("b.z > 0", "/b.z is not a number of this stream; it has /a.m.p.x, /a.v"),
    ):
        with pytest.raises(ConditionError) as refused:
            Condition(text).check(schema)
        assert said in str(refused.value)


def test_a_batch_with_only_dropped_cycles_matches_nothing() -> None:
    column = ports_pb2.PortColumn(component="/a", name="q", size=24)
    schema = PortSchema((column,), (), {"/a.q": Signal("/a.q", "", 0, "<f8", (3,), 0)})
    message = ports_pb2.PortBatch(first_cycle=7, lost=5, values=[b""])
    batch = PortBatch(schema, 1, 7, 5, False, message)
    assert not len(Condition("a.q[2] > 1 or isnan(a.q[0])").where(batch))
