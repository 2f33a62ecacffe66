"""Enumerators as short words: REALTIME_REQUIRED of the enum Realtime is "required".

Commands, configuration files, graph files and outputs all use these.
"""

import re
from typing import Any


def word(enum_type: Any, value: int) -> str:
    """Return the word of a value, by the enum's descriptor."""
    found = enum_type.values_by_number.get(value)
    return str(value) if found is None else _short(enum_type, found.name)


def choices(enum_type: Any) -> dict[str, int]:
    """Return the value of each word, by the enum's descriptor; "unspecified" is none of them."""
    return {_short(enum_type, each.name): each.number for each in enum_type.values if each.number}


def _short(enum_type: Any, name: str) -> str:
    prefix = re.sub(r"(?<!^)(?=[A-Z])", "_", enum_type.name).upper() + "_"
    return name.removeprefix(prefix).lower()
