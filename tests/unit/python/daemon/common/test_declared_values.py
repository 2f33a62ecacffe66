"""Checks of values for a component that no executor has."""

from typing import Any

import pytest
import yaml
from parameter_rule import SCALARS
from rtcf.v1 import graph_pb2
from rtcf_launch import component_parameters
from rtcf_shared.spec import parse_value
from rtcfd.common import declared_values
from rtcfd.common.errors import InvalidArgument

KNOBS = {
    name: graph_pb2.ParameterInfo(name=name, type=kind, default_value=parse_value(default))
    for name, kind, default in (
        ("label", "string", "abc"),
        ("rate", "double", "1.5"),
        ("count", "int", "2"),
        ("enabled", "bool", "true"),
        ("mode", "enum", "run"),
    )
}


@pytest.mark.parametrize(("name", "text", "wanted"), SCALARS)
def test_values_of_other_types_follow_the_rule_of_the_executor(
    name: str, text: str, wanted: Any
) -> None:
    # As from a launch.
    ((setting,), _, _) = component_parameters.settings({name: yaml.safe_load(text)}, KNOBS)
    if wanted is None:
        with pytest.raises(InvalidArgument, match=f"parameter {name} takes "):
            declared_values.check("/knobs", setting, KNOBS)
        return
    declared_values.check("/knobs", setting, KNOBS)
    kind = setting.value.WhichOneof("kind")
    assert kind == KNOBS[name].default_value.WhichOneof("kind")
    assert getattr(setting.value, str(kind)) == wanted
