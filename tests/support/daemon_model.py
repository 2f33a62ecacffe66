"""A model of rtcfd's state, for random tests: runners, their components, values and history.

It has two types of rtcf_test: Knobs, with a parameter of each type, and Weights, with a vector
(its elements and its size).  It shares no code with rtcfd.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

Value = bool | int | float | str
Values = dict[str, Value]

PACKAGE = "rtcf_test"
SIZE, ELEMENTS = "filter/taps_size", 8
DEFAULTS: Mapping[str, Values] = {
    "Knobs": {"enabled": True, "count": 2, "rate": 1.5, "label": "abc"},
    "Weights": {
        **{f"filter/taps_{k}": 0.5 if k == 0 else 0.25 for k in range(ELEMENTS)},
        SIZE: 3,
    },
}


class Rejected(Exception):
    """The model rejects a change."""


@dataclass(frozen=True)
class Wanted:
    """A component that a change asks for."""

    name: str  # full name
    type: str
    given: Values = field(default_factory=dict)


@dataclass
class Component:
    """A component of a runner: its type, its given parameters and all of its values."""

    type: str
    given: Values
    values: Values


# The parameters of one change, with the values before (None: there was none) and after it.
Change = dict[str, tuple[Value | None, Value]]


class Runner:
    """The components of a runner by full name, and the changes that can be undone, by name."""

    def __init__(self) -> None:
        self.components: dict[str, Component] = {}
        self.changes: dict[str, list[Change]] = {}

    def load(self, wanted: Wanted) -> None:
        """Load a component."""
        if wanted.name in self.components:
            raise Rejected(f"{wanted.name} exists")
        _check(wanted.type, wanted.given)
        self._put(wanted, DEFAULTS[wanted.type])
        self._note(wanted.name, {each: (None, value) for each, value in wanted.given.items()})

    def unload(self, names: list[str]) -> None:
        """Unload components; their changes stay in the history."""
        for name in names:
            self._get(name)
        for name in names:
            self.components.pop(name, None)

    def set_some(self, name: str, batch: Values) -> None:
        """Change parameters, all or none."""
        component = self._get(name)
        _check(component.type, batch, component.values)
        self._note(name, {each: (component.values[each], new) for each, new in batch.items()})
        component.given |= batch
        component.values |= batch

    def undo(self, name: str) -> None:
        """Undo the last change of a component that is not undone."""
        if not (changes := self.changes.get(name)):
            raise Rejected(f"nothing to undo of {name}")
        component = self._get(name)
        last = changes[-1]
        for each, (before, after) in last.items():
            if before is None or component.values.get(each) != after:
                raise Rejected(f"{name}.{each} has no earlier value, or was changed since")
        old = {each: before for each, (before, _) in last.items() if before is not None}
        _check(component.type, old, component.values)
        changes.pop()
        component.given |= old
        component.values |= old

    def replace(self, name: str, wanted: Wanted) -> None:
        """Replace a component by one of the same type, which keeps values that are not given."""
        old = self._get(name)
        assert old.type == wanted.type
        if wanted.name != name and wanted.name in self.components:
            raise Rejected(f"{wanted.name} exists")
        _check(wanted.type, wanted.given, old.values)
        del self.components[name]
        kept = {each: old.values[each] for each in old.given}
        self._put(Wanted(wanted.name, wanted.type, kept | wanted.given), old.values)
        self._note(
            wanted.name,
            {
                each: (old.values[each], new)
                for each, new in wanted.given.items()
                if old.values[each] != new
            },
        )

    def apply(self, graph: list[Wanted]) -> None:
        """Change the whole graph; parameters that are not given have their defaults."""
        if len({each.name for each in graph}) < len(graph):
            raise Rejected("a name stands twice")
        for each in graph:
            _check(each.type, each.given)
        before, self.components = self.components, {}
        for each in graph:
            self._put(each, DEFAULTS[each.type])
            old = before.get(each.name)
            if old is None:
                self._note(each.name, {name: (None, value) for name, value in each.given.items()})
                continue
            now = self.components[each.name].values
            changed = {name: (old.values[name], now[name]) for name in now}
            self._note(each.name, {name: one for name, one in changed.items() if one[0] != one[1]})

    def _get(self, name: str) -> Component:
        if name not in self.components:
            raise Rejected(f"no {name}")
        return self.components[name]

    def _put(self, wanted: Wanted, base: Values) -> None:
        self.components[wanted.name] = Component(
            wanted.type, dict(wanted.given), {**base, **wanted.given}
        )

    def _note(self, name: str, change: Change) -> None:
        if change:
            self.changes.setdefault(name, []).append(change)


_RANGES: Mapping[str, Callable[[Value], bool]] = {
    "enabled": lambda value: isinstance(value, bool),
    "count": lambda value: type(value) is int and 0 <= value <= 10,
    "rate": lambda value: type(value) in (int, float) and -1 <= float(value) <= 1e3,
    "label": lambda value: isinstance(value, str),
    SIZE: lambda value: type(value) is int and 1 <= value <= ELEMENTS,
}


def _check(kind: str, given: Values, present: Values | None = None) -> None:
    for name, value in given.items():
        if name not in DEFAULTS[kind]:
            raise Rejected(f"{kind} has no {name}")
        valid = _RANGES.get(name, lambda value: type(value) in (int, float) and float(value) >= -10)
        if not valid(value):
            raise Rejected(f"{name} = {value!r}")
