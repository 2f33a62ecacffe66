"""The configuration file, /etc/rtcfd/rtcfd.toml: reading and checking.

    [daemon]            socket, path, realtime, state_dir, runtime_dir, executor, ros_services
    [runner]            defaults of runners, named as in RunnerSettings
    [runner.ros]        likewise, named as in RosSettings

Every key is optional; an unknown one is refused by name.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rtcf.enums import choices
from rtcf.naming import listing, suggestion
from rtcf.v1 import runner_pb2

from rtcfd import ros_services, settings
from rtcfd.errors import InvalidArgument, Refusal

DEFAULT_FILE = Path("/etc/rtcfd/rtcfd.toml")


@dataclass
class Config:
    """What a configuration file says; None or empty where it says nothing."""

    socket: Path | None = None
    state_dir: Path | None = None
    runtime_dir: Path | None = None
    executor: Path | None = None
    path: list[Path] = field(default_factory=list)
    realtime: str = ""
    ros_services: str = ""
    runner: runner_pb2.RunnerSettings = field(default_factory=runner_pb2.RunnerSettings)


def read(file: Path) -> Config:
    """Read a configuration file; a Refusal names the file and what is wrong in it."""
    try:
        document = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidArgument(f"cannot read {file}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InvalidArgument(f"{file}: {error}") from None
    config = Config()
    try:
        _check_keys("", document, ("daemon", "runner"))
        _read_daemon(_table(document, "daemon"), config)
        _read_message(_table(document, "runner"), "runner", config.runner)
        settings.check(config.runner)
    except Refusal as refusal:
        raise InvalidArgument(f"{file}: {refusal}") from None
    return config


def _read_daemon(table: dict[str, Any], config: Config) -> None:
    paths = ("socket", "state_dir", "runtime_dir", "executor")
    _check_keys("daemon.", table, (*paths, "path", "realtime", "ros_services"))
    for name in paths:
        if name in table:
            setattr(config, name, _absolute_path(f"daemon.{name}", table[name]))
    folders = table.get("path", [])
    if not isinstance(folders, list):
        raise InvalidArgument("daemon.path must be a list of folders")
    config.path = [_absolute_path("daemon.path", folder) for folder in folders]
    if "realtime" in table:
        _enumerator("daemon.realtime", runner_pb2.Realtime.DESCRIPTOR, table["realtime"])
        config.realtime = table["realtime"]
    if "ros_services" in table:
        config.ros_services = _word("daemon.ros_services", ros_services.LEVELS, table)


def _read_message(table: dict[str, Any], where: str, message: Any) -> None:
    """Set the fields of a settings message by the keys of a table."""
    fields = message.DESCRIPTOR.fields_by_name
    _check_keys(where + ".", table, fields)
    for key, value in table.items():
        descriptor = fields[key]
        name = f"{where}.{key}"
        if descriptor.message_type is not None:
            if not isinstance(value, dict):
                raise InvalidArgument(f"{name} must be a table")
            _read_message(value, name, getattr(message, key))
        elif descriptor.enum_type is not None:
            setattr(message, key, _enumerator(name, descriptor.enum_type, value))
        else:
            _set_scalar(message, key, name, value, type(descriptor.default_value))


def _set_scalar(message: Any, key: str, name: str, value: Any, expected: type) -> None:
    if expected is float and type(value) is int:
        value = float(value)
    if type(value) is not expected:
        word = {bool: "true or false", int: "an integer", float: "a number", str: "a string"}
        raise InvalidArgument(f"{name} must be {word[expected]}, not {value!r}")
    try:
        setattr(message, key, value)
    except ValueError:
        raise InvalidArgument(f"{name} is out of range: {value}") from None


def _enumerator(name: str, enum_type: Any, value: Any) -> int:
    known = choices(enum_type)
    if not isinstance(value, str) or value not in known:
        raise InvalidArgument(f"{name} must be one of {', '.join(known)}, not {value!r}")
    return known[value]


def _word(name: str, known: Sequence[str], table: dict[str, Any]) -> str:
    value = table[name.rpartition(".")[2]]
    if value not in known:
        raise InvalidArgument(f"{name} must be one of {', '.join(known)}, not {value!r}")
    return str(value)


def _absolute_path(name: str, value: Any) -> Path:
    if not isinstance(value, str) or not value.startswith("/"):
        raise InvalidArgument(f"{name} must be an absolute path, not {value!r}")
    return Path(value)


def _table(document: dict[str, Any], name: str) -> dict[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise InvalidArgument(f"{name} must be a table")
    return table


def _check_keys(where: str, table: dict[str, Any], known: Any) -> None:
    for key in table:
        if key not in known:
            raise InvalidArgument(
                f'unknown key "{where}{key}"{suggestion(key, known)} (known: {listing(known)})'
            )
