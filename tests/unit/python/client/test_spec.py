"""Parameters, remaps and ports from command line words."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rtcf


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("true", "bool_value", True),
        ("False", "bool_value", False),
        ("1", "int_value", 1),
        ("-12", "int_value", -12),
        ("007", "int_value", 7),
        ("0x10", "int_value", 16),
        ("0o17", "int_value", 15),
        ("1.", "double_value", 1.0),
        ("1e-3", "double_value", 1e-3),
        ("-.5", "double_value", -0.5),
        (".inf", "double_value", math.inf),
        ("-.inf", "double_value", -math.inf),
        ("yes", "string_value", "yes"),
        ("'1'", "string_value", "1"),
        ("'it''s'", "string_value", "it's"),
        ('"a\\tb"', "string_value", "a\tb"),
        ("", "string_value", ""),
        ("1.2.3", "string_value", "1.2.3"),
        ("e5", "string_value", "e5"),
        (".", "string_value", "."),
    ],
)
def test_values_are_typed_as_yaml_scalars(text: str, kind: str, value: object) -> None:
    found = rtcf.parse_value(text)
    assert found.WhichOneof("kind") == kind
    assert getattr(found, kind) == value


def test_nan_is_a_number() -> None:
    assert math.isnan(rtcf.parse_value(".nan").double_value)


def test_an_integer_of_more_than_64_bits_is_rejected() -> None:
    assert rtcf.parse_value(str(2**63 - 1)).int_value == 2**63 - 1
    with pytest.raises(ValueError, match="64 bits"):
        rtcf.parse_value(str(2**63))
    for digits in ("9" * 5000, "0x" + "f" * 9000):
        with pytest.raises(ValueError, match="64 bits") as refused:
            rtcf.parse_value(digits)
        assert len(str(refused.value)) < 100


def test_a_parameter_value_may_contain_the_separator() -> None:
    setting = rtcf.parse_parameter("map := a:=b")
    assert (setting.name, setting.value.string_value) == ("map", "a:=b")


@pytest.mark.parametrize("text", ["a", "a=b", ":=b"])
def test_a_parameter_without_separator_is_rejected(text: str) -> None:
    with pytest.raises(ValueError, match="a parameter is name:=value"):
        rtcf.parse_parameter(text)


@pytest.mark.parametrize("text", ["a", "a:=", ":=b"])
def test_an_incomplete_remap_is_rejected(text: str) -> None:
    with pytest.raises(ValueError, match="a remap is from:=to"):
        rtcf.parse_remap(text)


@pytest.mark.parametrize("name", ["remaps", "parameters", "breaks"])
def test_a_text_is_not_treated_as_a_list_of_letters(name: str) -> None:
    given: dict[str, Any] = {name: "in:=/x"}
    with pytest.raises(TypeError, match=rf"{name} must be a list: \['in:=/x'\], not 'in"):
        rtcf.component("p", "T", **given)


TEXT: Any = "/x"
CALLS: dict[str, Callable[[rtcf.Client], object]] = {
    "components to unload": lambda client: client.unload(TEXT),
    "components to release": lambda client: client.release(TEXT),
    "components of a graph": lambda client: client.apply(TEXT),
    "ports": lambda client: client.set_breaks(TEXT, True),
    "parameters": lambda client: client.set_parameters("a", TEXT),
    "states": lambda client: client.set_state("a", TEXT),
    "runners": lambda client: client.watch_events(TEXT),
    "components to listen to": lambda client: client.watch_logs("", TEXT),
    "selection": lambda client: client.watch_ports(TEXT),
}


@pytest.mark.parametrize("call", CALLS)
def test_a_text_is_not_treated_as_a_list_of_names(tmp_path: Path, call: str) -> None:
    said = rf"{call.split()[0]} must be a list: \['/x'\], not '/x'"
    with rtcf.Client(tmp_path / "none") as client, pytest.raises(TypeError, match=said):
        CALLS[call](client)


def test_a_port_is_the_part_after_the_last_dot() -> None:
    port = rtcf.parse_port("/arm/H1.in1")
    assert (port.component, port.port) == ("/arm/H1", "in1")
    with pytest.raises(ValueError, match=r"COMPONENT\.PORT"):
        rtcf.parse_port("in1")
