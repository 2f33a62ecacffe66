"""rtcfctl's tables: they fit the terminal, and no number is cut."""

import json
import time

import pytest
from rtcf.v1 import graph_pb2
from rtcfctl.terminal import words
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.plain import plain
from rtcfctl.terminal.table import Cell, format_table


def lines(
    columns: tuple[str, ...], *rows: tuple[str, ...], right: tuple[str, ...] = (), width: int = 80
) -> list[str]:
    cells: list[list[Cell]] = [[(text, "") for text in row] for row in rows]
    folded = format_table(columns, cells, right, width)
    return ["".join(text for text, _ in line).rstrip() for line in folded]


def test_columns_are_as_wide_as_their_content() -> None:
    assert lines(("name", "Hz"), ("arm", "50"), ("rt_runner", "2000"), right=("Hz",)) == [
        "name         Hz",
        "arm          50",
        "rt_runner  2000",
    ]


def test_columns_without_content_are_left_out() -> None:
    assert lines(("name", "unit", "value"), ("a", "", "1"), ("b", "", "2"))[0] == "name  value"


def test_text_is_wrapped_but_numbers_are_not() -> None:
    text = "ignores /arm/.*, loop break at in1, in2, held by rt_launcher /arm/filter (pid 4711)"
    found = lines(("component", "notes", "µs"), ("/arm/filter", text, "123456.78"),
                  right=("µs",), width=60)  # fmt: skip
    assert max(map(len, found)) <= 60
    assert "123456.78" in found[1]
    assert "4711)" in found[-1]
    # Without a terminal nothing is wrapped.
    cells: list[list[Cell]] = [[(text, ""), ("1", "")]]
    assert len(list(format_table(("notes", "µs"), cells))) == 2


def test_values_have_the_significant_digits() -> None:
    assert words.port_value("data: 0.30000000000000004") == "0.3"
    assert words.port_value("{x: 1.23456789012, y: -2e-07}") == "{x: 1.23457, y: -2e-07}"
    durations = (-1_500.0, 999_000.0, 1_234_567.0, 123_456_789.0)
    assert [*map(words.microseconds, durations)] == ["-1.50", "999.00", "1234.6", "123457"]
    chosen = graph_pb2.ParameterValue(double_value=0.1 + 0.2)
    assert words.value(chosen) == "0.3"
    assert words.value(graph_pb2.ParameterValue(double_value=12345678.9)) == "12345678.9"
    assert words.value(graph_pb2.ParameterValue(int_value=12345678901)) == "12345678901"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2.5", 2.5),
        ("data: 1e-07", {"data": 1e-07}),
        ("{x: 1.5, y: [1, -2E+5], z: {on: true}}", {"x": 1.5, "y": [1, -2e5], "z": {"on": True}}),
        ("{a: 12:30, b: 2026-11-22, c: no, d: 0x10, e: 010}",
         {"a": "12:30", "b": "2026-11-22", "c": "no", "d": "0x10", "e": 10}),
        (r'data: "5 \x0a \"x\""', {"data": '5 \n "x"'}),
        ("[1; 2; 3]", [1, 2, 3]),
        ("{m: [1, 2; 3, 4e-9]}", {"m": [[1, 2], [3, 4e-9]]}),
        ("[nan; -inf]", ["nan", "-inf"]),
        ("{x: 1, ...", "{x: 1, ..."),
    ],
)  # fmt: skip
def test_port_values_are_numbers_and_objects_in_json(text: str, value: object) -> None:
    assert plain(graph_pb2.PortInfo(name="out", value=text))["value"] == value
    json.dumps(value, allow_nan=False)


def test_state_values_are_numbers_or_null_in_json() -> None:
    state = plain(graph_pb2.StateInfo(type="double[2]", initial="[0, 1e-05]"))
    assert (state["initial"], state["value"]) == ([0, 1e-05], None)
    assert plain(graph_pb2.PortInfo())["value"] is None


def test_long_operations_print_their_progress(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = time.monotonic()
    output = Output("table")
    output.progress("a")
    monkeypatch.setattr(time, "monotonic", lambda: now + 11.0)
    output.progress("b")
    assert capsys.readouterr().err == "b\n"
