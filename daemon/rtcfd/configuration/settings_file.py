"""The configuration file, /etc/rtcfd/rtcfd.toml: reading and checking.

    [daemon]            socket, path, realtime, state_dir, runtime_dir, graphs_dir, executor
    [access]            default, and the users and @groups of each level
    [[access.parameters]]  rules on parameters: who, runner, names, most_per_s
    [limits]            named as in common/limits.py
    [runner]            defaults of runners, named as in RunnerSettings
    [runner.ros]        likewise, named as in RosSettings

Every key is optional.  An unknown key, a value of the wrong type or out of range is an
error with its name and line.
"""

import math
import os
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from rtcf.v1 import errors_pb2, runner_pb2
from rtcf_shared.enums import choices
from rtcf_shared.naming import listing, suggestion

from rtcfd.access import rights
from rtcfd.access.rights import Access, Level, Rule
from rtcfd.common import regular_files, runner_settings
from rtcfd.common.errors import InvalidArgument, RequestError
from rtcfd.common.limits import RANGES, Limits

DEFAULT_FILE = Path("/etc/rtcfd/rtcfd.toml")

_PATHS = ("socket", "state_dir", "runtime_dir", "graphs_dir", "executor")
# The names that adduser(8) and systemd allow; groups begin with @.
_PRINCIPAL = re.compile(r"@?[A-Za-z_][A-Za-z0-9_.-]*\$?")
_INTEGERS = range(-(2**63), 2**63)
_ENDLESS = re.compile(r"\d[\d_]{4300}")  # sys.int_info.default_max_str_digits
_TYPE_WORDS = {bool: "true or false", int: "an integer", float: "a number", str: "a string"}

# Lines of a TOML file.
_TABLE = re.compile(r"\s*\[\s*([^\[\]]+?)\s*\]\s*(#.*)?$")
_ENTRY = re.compile(r"\s*\[\[\s*([^\[\]]+?)\s*\]\]\s*(#.*)?$")
_KEY = re.compile(r"\s*([A-Za-z0-9_.\"'-]+(?:\s*\.\s*[A-Za-z0-9_\"'-]+)*)\s*=")


@dataclass
class Config:
    """The content of a configuration file; None or empty where it has no value."""

    socket: Path | None = None
    state_dir: Path | None = None
    runtime_dir: Path | None = None
    graphs_dir: Path | None = None
    executor: Path | None = None
    path: list[Path] = field(default_factory=list)
    realtime: str = ""
    runner: runner_pb2.RunnerSettings = field(default_factory=runner_pb2.RunnerSettings)
    access: Access = field(default_factory=Access)
    limits: Limits = field(default_factory=Limits)
    text: str = field(default="", repr=False)  # of the file


# Returns why an executor would reject the settings of a file; empty = it accepts them.
SettingsError = Callable[[Config], str]


class _InvalidKey(InvalidArgument):
    """An error in the value of a key."""

    def __init__(self, key: str, text: str) -> None:
        super().__init__(text, errors_pb2.REASON_SETTINGS_FILE_INVALID)
        self.key = key


def read(
    file: Path, settings_error: SettingsError = lambda _: "", *, writable: bool = False
) -> Config:
    """Read a configuration file; raises RequestError with the file, the line and the error.

    `settings_error` asks an executor whether it accepts the settings of runners.  With `writable`,
    this process must be able to write to the named folders.
    """
    text, document = _document(file)
    config = Config(text=text)
    try:
        _check_numbers(document, "")
        _check_keys("", document, ("daemon", "access", "limits", "runner"))
        _read_daemon(_table(document, "daemon"), config)
        if writable:
            _require_writable(config)
        _read_access(_table(document, "access"), config)
        _read_limits(_table(document, "limits"), config)
        _read_message(_table(document, "runner"), "runner", config.runner)
        _check_runner(config.runner)
        if config.runner.ListFields() and (reason := settings_error(config)):
            raise _InvalidKey(_key(reason), reason)
    except _InvalidKey as wrong:
        lines = _lines_of_keys(text)
        # A missing key, or one of an inline table, has the line of its table.
        line = lines.get(wrong.key) or lines.get(wrong.key.rpartition(".")[0])
        where = f"{file}:{line}" if line else str(file)
        raise InvalidArgument(
            f"{where}: {wrong}", errors_pb2.REASON_SETTINGS_FILE_INVALID
        ) from None
    except RecursionError:
        raise _too_deep(file) from None
    return config


def read_socket(file: Path) -> Path | None:
    """Return the control socket that a file names, whatever else is wrong in it; None = none.

    Raises RequestError for a file that cannot be read or is no TOML.
    """
    _, document = _document(file)
    try:
        table = _table(document, "daemon")
        return _absolute_path("daemon.socket", table["socket"]) if "socket" in table else None
    except _InvalidKey:
        return None


def _document(file: Path) -> tuple[str, dict[str, Any]]:
    """Return the text of a file, and its content; raises RequestError."""
    text = ""
    try:
        # Some editors write a byte order mark.
        text = regular_files.read_text(file, encoding="utf-8-sig")
        return text, tomllib.loads(text)
    except OSError as error:
        raise InvalidArgument(
            f"cannot read {file}: {error.strerror}", errors_pb2.REASON_SETTINGS_FILE_INVALID
        ) from None
    except UnicodeDecodeError:
        raise InvalidArgument(
            f"{file}: it is not UTF-8 text", errors_pb2.REASON_SETTINGS_FILE_INVALID
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise InvalidArgument(f"{file}: {error}", errors_pb2.REASON_SETTINGS_FILE_INVALID) from None
    except ValueError:
        # Python rejects integers of thousands of digits.
        digits = _ENDLESS.search(text)
        place = f":{text.count(chr(10), 0, digits.start()) + 1}" if digits else ""
        raise InvalidArgument(
            f"{file}{place}: an integer does not fit into 64 bits",
            errors_pb2.REASON_SETTINGS_FILE_INVALID,
        ) from None
    except RecursionError:
        raise _too_deep(file) from None


def _too_deep(file: Path) -> InvalidArgument:
    return InvalidArgument(
        f"{file}: lists or tables in it are nested too deep",
        errors_pb2.REASON_SETTINGS_FILE_INVALID,
    )


def _check_numbers(value: Any, key: str) -> None:
    """Reject numbers that no setting can have, anywhere in the document.

    Python's integers are unbounded, and infinity would satisfy every lower bound.
    """
    if isinstance(value, dict):
        for name, each in value.items():
            _check_numbers(each, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for number, each in enumerate(value):
            _check_numbers(each, f"{key}[{number}]" if isinstance(each, dict) else key)
    elif isinstance(value, int) and value not in _INTEGERS:
        raise _InvalidKey(key, f"{key}: an integer does not fit into 64 bits")
    elif isinstance(value, float) and not math.isfinite(value):
        raise _InvalidKey(key, f"{key} must be a finite number, not {value}")


def _read_daemon(table: dict[str, Any], config: Config) -> None:
    _check_keys("daemon.", table, (*_PATHS, "path", "realtime"))
    for name in _PATHS:
        if name in table:
            setattr(config, name, _absolute_path(f"daemon.{name}", table[name]))
    folders = table.get("path", [])
    if not isinstance(folders, list):
        raise _InvalidKey("daemon.path", "daemon.path must be a list of folders")
    config.path = [_absolute_path("daemon.path", folder) for folder in folders]
    if "realtime" in table:
        _enumerator("daemon.realtime", runner_pb2.Realtime.DESCRIPTOR, table["realtime"])
        config.realtime = table["realtime"]


def _require_writable(config: Config) -> None:
    for name in ("state_dir", "runtime_dir"):
        folder: Path | None = getattr(config, name)
        if folder is not None and (why := unwritable(folder)):
            raise _InvalidKey(f"daemon.{name}", f"daemon.{name}: {why}")


def unwritable(folder: Path) -> str:
    """Return why this process cannot write to a folder, which may not exist yet; empty = it can."""
    there = folder
    while not os.path.exists(there):
        there = there.parent
    if not there.is_dir():
        return f"{there} is not a folder"
    if os.access(there, os.W_OK | os.X_OK):
        return ""
    if os.statvfs(there).f_flag & os.ST_RDONLY:
        return (
            f"{there} is read-only: in the sandbox of the service, `systemctl edit rtcfd` with "
            f"ReadWritePaths={folder} under [Service] permits it"
        )
    return f"user {os.geteuid()} may not write to {there}: change its owner"


def _read_access(table: dict[str, Any], config: Config) -> None:
    lists = [level.word for level in Level if level > Level.NONE]
    _check_keys("access.", table, ("default", "parameters", *lists))
    default = _level("access.default", table.get("default", config.access.default.word))
    named: dict[Level, list[str]] = {}
    seen: dict[str, str] = {}
    for word in lists:
        key = f"access.{word}"
        names = table.get(word, [])
        if not isinstance(names, list):
            raise _InvalidKey(key, f"{key} must be a list of users and @groups, not {names!r}")
        for name in names:
            if not isinstance(name, str) or not _PRINCIPAL.fullmatch(name):
                raise _InvalidKey(key, f"{key}: {name!r} is neither a user nor a @group")
            if name in seen:
                raise _InvalidKey(key, f"{key}: {name} is already in {seen[name]}")
            seen[name] = key
        named[rights.WORDS[word]] = names
    rules = table.get("parameters", [])
    if not isinstance(rules, list) or not all(isinstance(rule, dict) for rule in rules):
        raise _InvalidKey(
            "access.parameters", "access.parameters must be tables: [[access.parameters]]"
        )
    config.access = rights.rules(named, default, tuple(_parameter_rules(rules)))


def _parameter_rules(tables: list[dict[str, Any]]) -> Iterator[Rule]:
    for number, table in enumerate(tables):
        try:
            yield _parameter_rule(table)
        except _InvalidKey as wrong:
            wrong.key = wrong.key.replace("parameters", f"parameters[{number}]", 1)
            raise


def _parameter_rule(table: dict[str, Any]) -> Rule:
    """Return the rule of one table."""
    key = "access.parameters"
    _check_keys(f"{key}.", table, ("who", "runner", "names", "most_per_s"))
    who, names, runner = table.get("who"), table.get("names", [".*"]), table.get("runner", ".*")
    if not isinstance(who, list) or not all(
        isinstance(name, str) and _PRINCIPAL.fullmatch(name) for name in who
    ):
        raise _InvalidKey(
            f"{key}.who", f"{key}: who must be a list of users and @groups, not {who!r}"
        )
    if not isinstance(names, list):
        raise _InvalidKey(
            f"{key}.names", f"{key}: names must be a list of expressions, not {names!r}"
        )
    for field_name, pattern in (*(("names", name) for name in names), ("runner", runner)):
        try:
            re.compile(pattern)
        except (re.error, TypeError) as error:
            raise _InvalidKey(
                f"{key}.{field_name}",
                f"{key}: {pattern!r} is not a regular expression: {error}",
            ) from None
    pace = table.get("most_per_s")
    if pace is not None and (type(pace) not in (int, float) or not pace > 0):
        raise _InvalidKey(f"{key}.most_per_s", f"{key}: most_per_s must be above 0, not {pace!r}")
    return Rule(frozenset(who), runner, tuple(names), pace)


def _read_limits(table: dict[str, Any], config: Config) -> None:
    _check_keys("limits.", table, [each.name for each in fields(Limits)])
    for name, value in table.items():
        key, (least, most) = f"limits.{name}", RANGES[name]
        if type(value) is not int:
            raise _InvalidKey(key, f"{key} must be an integer, not {value!r}")
        if not least <= value <= most:
            raise _InvalidKey(key, f"{key} of {value} is out of range: {least} to {most}")
    config.limits = Limits(**table)


def _read_message(table: dict[str, Any], where: str, message: Any) -> None:
    """Set the fields of a settings message by the keys of a table."""
    known = message.DESCRIPTOR.fields_by_name
    _check_keys(where + ".", table, known)
    for key, value in table.items():
        descriptor = known[key]
        name = f"{where}.{key}"
        if descriptor.message_type is not None:
            if not isinstance(value, dict):
                raise _InvalidKey(name, f"{name} must be a table")
            _read_message(value, name, getattr(message, key))
        elif descriptor.enum_type is not None:
            setattr(message, key, _enumerator(name, descriptor.enum_type, value))
        else:
            _set_scalar(message, key, name, value, type(descriptor.default_value))


def _set_scalar(message: Any, key: str, name: str, value: Any, expected: type) -> None:
    if expected is float and type(value) is int:
        value = float(value)
    if type(value) is not expected:
        raise _InvalidKey(name, f"{name} must be {_TYPE_WORDS[expected]}, not {value!r}")
    try:
        setattr(message, key, value)
    except ValueError:
        raise _InvalidKey(name, f"{name} is out of range: {value}") from None


def _check_runner(runner: runner_pb2.RunnerSettings) -> None:
    """Check each value by itself, so that an error has its key."""
    for descriptor, value in runner.ListFields():
        key = f"runner.{descriptor.name}"
        if descriptor.message_type is None:
            _check_alone(key, runner_pb2.RunnerSettings(**{descriptor.name: value}))
            continue
        for inner, inner_value in value.ListFields():
            alone = type(value)(**{inner.name: inner_value})
            _check_alone(
                f"{key}.{inner.name}", runner_pb2.RunnerSettings(**{descriptor.name: alone})
            )


def _key(error: str) -> str:
    """Return the key that an executor's error begins with."""
    first = re.match(r"\w*", error)
    known = runner_pb2.RosSettings.DESCRIPTOR.fields_by_name
    return f"runner.ros.{first[0]}" if first and first[0] in known else "runner"


def _check_alone(key: str, settings: runner_pb2.RunnerSettings) -> None:
    try:
        runner_settings.check(settings)
    except RequestError as error:
        raise _InvalidKey(key, str(error)) from None


def _enumerator(name: str, enum_type: Any, value: Any) -> int:
    known = choices(enum_type)
    if not isinstance(value, str) or value not in known:
        raise _InvalidKey(name, f"{name} must be one of {', '.join(known)}, not {value!r}")
    return known[value]


def _level(name: str, value: Any) -> Level:
    if not isinstance(value, str) or value not in rights.WORDS:
        raise _InvalidKey(name, f"{name} must be one of {', '.join(rights.WORDS)}, not {value!r}")
    return rights.WORDS[value]


def _absolute_path(name: str, value: Any) -> Path:
    if not isinstance(value, str) or not value.startswith("/"):
        raise _InvalidKey(name, f"{name} must be an absolute path, not {value!r}")
    if "\0" in value:
        raise _InvalidKey(name, f"{name} must be a path, not {value!r}")
    return Path(value)


def _table(document: dict[str, Any], name: str) -> dict[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise _InvalidKey(name, f"{name} must be a table")
    return table


def _check_keys(where: str, table: dict[str, Any], known: Iterable[str]) -> None:
    names = list(known)
    for key in table:
        if key not in names:
            raise _InvalidKey(
                f"{where}{key}",
                f'unknown key "{where}{key}"{suggestion(key, names)} (known: {listing(names)})',
            )


def _lines_of_keys(text: str) -> dict[str, int]:
    """Return the line, from 1, of each table and key, which tomllib does not return.

    Keys are complete, as "runner.ros.queue", and with an index in tables of a list, as
    "access.parameters[0].who".
    """
    found: dict[str, int] = {}
    entries: Counter[str] = Counter()
    table = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if match := _TABLE.match(line):
            table = _plain(match[1])
            found.setdefault(table, number)
        elif match := _ENTRY.match(line):
            name = _plain(match[1])
            found.setdefault(name, number)
            table = f"{name}[{entries[name]}]"
            entries[name] += 1
            found[table] = number
        elif match := _KEY.match(line):
            key = _plain(match[1])
            found.setdefault(f"{table}.{key}" if table else key, number)
    return found


def _plain(name: str) -> str:
    return ".".join(part.strip().strip("\"'") for part in name.split("."))
