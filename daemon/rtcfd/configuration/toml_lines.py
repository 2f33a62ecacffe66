"""In which line of a TOML file a key stands: for messages, as tomllib does not tell."""

import re
from collections import Counter

_TABLE = re.compile(r"\s*\[\s*([^\[\]]+?)\s*\]\s*(#.*)?$")
_ENTRY = re.compile(r"\s*\[\[\s*([^\[\]]+?)\s*\]\]\s*(#.*)?$")
_KEY = re.compile(r"\s*([A-Za-z0-9_.\"'-]+(?:\s*\.\s*[A-Za-z0-9_\"'-]+)*)\s*=")


def lines_of_keys(text: str) -> dict[str, int]:
    """Return the line, from 1, of each table and key; keys in full: "runner.ros.queue", and of
    the tables of a list "access.parameters[0].who"."""
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
