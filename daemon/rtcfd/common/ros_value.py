"""Converts a value from YAML text to a serialised ROS message."""

import json
import re
import struct
from typing import Any

import yaml
from rtcf_shared.naming import listing, suggestion
from rtcf_shared.ros_definition import Definition, Field

_FORMATS = {"int8": "b", "byte": "b", "uint8": "B", "char": "B", "int16": "h", "uint16": "H",
            "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f",
            "float64": "d"}  # fmt: skip
_TIMES = {"time": "II", "duration": "ii"}
_WORDS = {"true": True, "false": False, "1": True, "0": False}
_MOST_SHOWN = 60  # characters
# The YAML parser takes about 5 s and 1 KB per number for each MB of text, that of JSON 15 ms.
_LONGEST_YAML = 64 * 1024  # characters
_JSON = json.JSONDecoder(parse_float=str, parse_int=str, parse_constant=str)
_NANOSECONDS = 1_000_000_000


class _Loader(yaml.BaseLoader):  # type: ignore[misc]
    """Reads all scalars as strings, because the message's definition gives their types.  Rejects
    aliases, with which a short text can expand to a huge value."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("an alias (*)")
        return super().compose_node(parent, index)


def encode(definition: str, text: str) -> bytes:
    """Return the serialised message; fields without a value are zero.

    JSON is YAML, too, and may be longer than other YAML.  Raises ValueError with a message of one
    line.
    """
    try:
        value = _parsed(text)
    except (yaml.YAMLError, RecursionError) as error:
        problem = getattr(error, "problem", None) or str(error)
        raise ValueError(f"invalid YAML: {' '.join(problem.split())}") from None
    return _Writer(Definition(definition)).message("", "" if value is None else value, "")


def _parsed(text: str) -> Any:
    """Return the value of a text with all scalars as strings."""
    try:
        return _scalars_as_text(_JSON.decode(text))
    except json.JSONDecodeError as error:
        if len(text) > _LONGEST_YAML:
            raise ValueError(
                f"YAML of {len(text)} characters is too long, at most {_LONGEST_YAML}: write JSON, "
                f"which this text is not ({error})"
            ) from None
    return yaml.load(text, _Loader)


def _scalars_as_text(value: Any) -> Any:
    if isinstance(value, list):
        return [_scalars_as_text(each) for each in value]
    if isinstance(value, dict):
        return {name: _scalars_as_text(each) for name, each in value.items()}
    return value if isinstance(value, str) else json.dumps(value)


class _Writer:
    """Serialises a value by a message definition."""

    def __init__(self, types: Definition) -> None:
        self._types = types

    def message(self, name: str, value: Any, path: str) -> bytes:
        """Return a message of the type `name`; "" is the type of the whole message."""
        fields = list(self._types.fields(name))
        named = self._by_name(fields, value, path)
        return b"".join(
            self._field(each, named.get(each.name), f"{path}.{each.name}" if path else each.name)
            for each in fields
        )

    def _by_name(self, fields: list[Field], value: Any, path: str) -> dict[str, Any]:
        names = [each.name for each in fields]
        if isinstance(value, dict):
            for each in value:
                if each not in names:
                    raise ValueError(
                        f"{_at(path)}no field {each}{suggestion(str(each), names)} "
                        f"(fields: {listing(names)})"
                    )
            return value
        # The types of std_msgs with the only field `data`, and its arrays with a layout.
        if "data" in names:
            return {"data": _flat(value) if "layout" in names else value}
        if isinstance(value, list) and len(value) == len(fields):
            return dict(zip(names, value, strict=True))
        raise ValueError(
            f"{_at(path)}{_shown(value)} is not a message: name its fields, as in "
            f"{{{', '.join(f'{each}: …' for each in names)}}}"
        )

    def _field(self, field: Field, value: Any, path: str) -> bytes:
        if not field.is_array:
            return self._single(field.kind, value, path)
        if value is None:
            value = [None] * (field.length or 0)
        if not isinstance(value, list):
            raise ValueError(f"{_at(path)}{_shown(value)} is not a list, as in [1, 2]")
        if field.length is not None and len(value) != field.length:
            raise ValueError(f"{_at(path)}{len(value)} values, {field.length} are needed")
        count = b"" if field.length is not None else struct.pack("<I", len(value))
        return count + b"".join(
            self._single(field.kind, each, f"{path}[{index}]") for index, each in enumerate(value)
        )

    def _single(self, kind: str, value: Any, path: str) -> bytes:
        if kind not in _FORMATS and kind not in _TIMES and kind not in ("bool", "string"):
            return self.message(kind, {} if value is None else value, path)
        if kind in _TIMES and isinstance(value, dict):
            return self._time(kind, value, path)
        if isinstance(value, dict | list):
            raise ValueError(f"{_at(path)}{_shown(value)} is not a valid {kind}")
        if kind == "string":
            data = ("" if value is None else str(value)).encode()
            return struct.pack("<I", len(data)) + data
        text = "0" if value is None else str(value).strip().lower()
        try:
            return _packed(kind, text)
        except (KeyError, ValueError, OverflowError, struct.error):
            raise ValueError(f"{_at(path)}{_shown(value)} is not a valid {kind}") from None

    def _time(self, kind: str, value: dict[str, Any], path: str) -> bytes:
        form = _TIMES[kind][0]
        number = {"I": "uint32", "i": "int32"}[form]
        fields = [Field("secs", number), Field("nsecs", number)]
        named = self._by_name(fields, value, path)
        return b"".join(
            self._single(each.kind, named.get(each.name), f"{path}.{each.name}") for each in fields
        )


def _packed(kind: str, text: str) -> bytes:
    if kind == "bool":
        return struct.pack("<?", _WORDS[text])
    if kind in _TIMES:
        seconds, rest = divmod(round(float(text) * _NANOSECONDS), _NANOSECONDS)
        return struct.pack(f"<{_TIMES[kind]}", seconds, rest)
    if kind.startswith("float"):
        # YAML writes .nan and .inf.
        number = float(re.sub(r"^([-+]?)\.(nan|inf)$", r"\1\2", text))
        return struct.pack(f"<{_FORMATS[kind]}", number)
    return struct.pack(f"<{_FORMATS[kind]}", int(text, 0))


def _flat(value: Any) -> Any:
    """Return the rows of a matrix as one list."""
    if isinstance(value, list) and any(isinstance(row, list) for row in value):
        return [each for row in value for each in (row if isinstance(row, list) else [row])]
    return value


def _at(path: str) -> str:
    return f"{path}: " if path else ""


def _shown(value: Any) -> str:
    if isinstance(value, dict | list):
        return "a list" if isinstance(value, list) else "a mapping"
    text = " ".join(str(value).split())
    return f'"{text}"' if len(text) <= _MOST_SHOWN else f'"{text[:_MOST_SHOWN]}…"'
