"""The rule by which a parameter takes a value of another type.  Tests check it for each way of a
value into a component."""

from typing import Any

import yaml

# A parameter of Knobs, a value in YAML 1.1, and the parameter's value; None = rejected.
CASES: list[tuple[str, str, Any]] = [
    ("label", "5", "5"),
    ("label", "2.5", "2.5"),
    ("label", "-3.0", "-3"),
    ("label", "true", "true"),
    ("label", "[1, 2]", None),
    ("label", "{a: 1}", None),
    ("rate", "2", 2.0),
    ("rate", "1e-3", 0.001),  # a text in YAML 1.1
    ("rate", "fast", None),
    ("rate", "true", None),
    ("rate", "[1.0, 2.0]", None),
    ("count", "3.0", 3),
    ("count", "2.5", None),
    ("count", "'3'", None),
    ("count", "true", None),
    ("count", "[3]", None),
    ("enabled", "0", False),
    ("enabled", "2", None),
    ("enabled", "'false'", None),
    ("mode", "1", None),
    ("mode", "[idle]", None),
]
SCALARS = [case for case in CASES if not isinstance(yaml.safe_load(case[1]), list | dict)]
