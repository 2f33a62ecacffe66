"""Finds the lines of the keys of a TOML file, for error messages; tomllib does not return them."""

import re
from collections import Counter

_TABLE = re.compile(r"\s*\[\s*([^\[\]]+?)\s*\]\s*(#.*)?$")
_ENTRY = re.compile(r"\s*\[\[\s*([^\[\]]+?)\s*\]\]\s*(#.*)?$")
_KEY = re.compile(r"\s*([A-Za-z0-9_.\"'-]+(?:\s*\.\s*[A-Za-z0-9_\"'-]+)*)\s*=")


def lines_of_keys(text: str) -> dict[str, int]:
    """Return the line, from 1, of each table and key.

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
