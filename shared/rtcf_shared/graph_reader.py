"""Reads graph files: YAML to Graph; each error has file and line.

docs/graph-files.md describes the format.  Scalars have the types of YAML 1.2 (see
spec.py), so that a graph file and the command line agree.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from typing import Any

from rtcf.v1 import graph_pb2, runner_pb2

from rtcf_shared.enums import choices
from rtcf_shared.errors import RtcfError
from rtcf_shared.naming import suggestion
from rtcf_shared.spec import parse_value

_GRAPH_KEYS = ("settings", "components")
_DEEPEST = 100  # mappings and lists in each other
_MOST_PARAMETERS = 10_000  # of a component
_COMPONENT_KEYS = ("name", "ns", "package", "type", "remaps", "parameters", "first", "ignore",
                   "breaks", "every", "phase", "optional")  # fmt: skip
_NOTHING = ("", "~", "null", "Null", "NULL")
_WORDS = {bool: "true or false", int: "an integer", float: "a number", str: "text"}


class GraphFileError(RtcfError):
    """A graph file is not valid; the text has the file, the line and the remedy."""


@dataclass
class Graph:
    """The graph of one runner, and its settings."""

    runner: str = ""  # empty = the file names none
    settings: runner_pb2.RunnerSettings = field(default_factory=runner_pb2.RunnerSettings)
    components: list[graph_pb2.ComponentSpec] = field(default_factory=list)


def read_graphs(text: str, file: str) -> list[Graph]:
    """Return the graphs in the text of a file; `file` is for errors.  Raises GraphFileError."""
    import yaml  # slow to import

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        _check_depth(yaml.parse(text, Loader=loader), file)  # compose() has no limit
        root = yaml.compose(text, Loader=loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"{file}:{mark.line + 1}" if mark else file
        problem = getattr(error, "problem", None) or error
        raise GraphFileError(f"{place}: {' '.join(str(problem).split())}") from None
    if root is None:
        raise GraphFileError(f"{file}: it has no graph")
    return _Reader(file).document(root)


def _check_depth(events: Iterable[Any], file: str) -> None:
    depth = 0
    for event in events:
        kind = type(event).__name__
        depth += kind.endswith("StartEvent") - kind.endswith("EndEvent")
        if depth > _DEEPEST:
            raise GraphFileError(
                f"{file}:{event.start_mark.line + 1}: more than {_DEEPEST} mappings or lists in "
                "each other"
            )


class _Reader:
    """Walks the nodes of one file; `where` names a node in errors."""

    def __init__(self, file: str) -> None:
        self._file = file

    def document(self, root: Any) -> list[Graph]:
        keys = self._mapping(root, "the file")
        if "runners" in keys:
            self._check_keys(keys, ("runners",), "beside runners")
            runners = self._mapping(keys["runners"][1], "runners")
            return [self._graph(node, name) for name, (_, node) in runners.items()]
        self._check_keys(keys, ("runner", *_GRAPH_KEYS, "runners"), "in a graph file")
        runner = self._text(keys.pop("runner")[1], "runner") if "runner" in keys else ""
        return [self._graph_of(root, keys, runner)]

    def _graph(self, node: Any, runner: str) -> Graph:
        keys = self._mapping(node, f"runner {runner}")
        self._check_keys(keys, _GRAPH_KEYS, f"of runner {runner}")
        return self._graph_of(node, keys, runner)

    def _graph_of(self, node: Any, keys: dict[str, tuple[Any, Any]], runner: str) -> Graph:
        graph = Graph(runner)
        if "settings" in keys:
            self._message(keys["settings"][1], "settings", graph.settings)
        if "components" not in keys:
            raise self._error(node, "components is missing; an empty graph is `components: []`")
        lines: dict[str, int] = {}
        for each in self._list(keys["components"][1], "components"):
            spec = self._component(each)
            name = f"{spec.ns.strip('/')}/{spec.name or spec.type}".lstrip("/")
            if name in lines:
                raise self._error(each, f"component /{name} is already in line {lines[name]}")
            lines[name] = each.start_mark.line + 1
            graph.components.append(spec)
        return graph

    def _component(self, node: Any) -> graph_pb2.ComponentSpec:
        keys = self._mapping(node, "a component")
        self._check_keys(keys, _COMPONENT_KEYS, "of a component")
        spec = graph_pb2.ComponentSpec()
        for needed in ("package", "type"):
            if needed not in keys:
                raise self._error(node, f"a component needs its {needed}")
        for key, (_, value) in keys.items():
            if key == "remaps":
                for port, (_, target) in self._mapping(value, key).items():
                    to = self._text(target, f"remaps.{port}")
                    spec.remaps.append(graph_pb2.Remap(source=port, target=to))
            elif key == "parameters":
                found: dict[str, graph_pb2.ParameterValue] = {}
                lists: dict[str, int] = {}
                for name, (_, content) in self._mapping(value, key).items():
                    self._parameters(name, content, found, lists)
                for name, each in found.items():
                    spec.parameters.add(name=name, value=each)
                for name, length in lists.items():
                    spec.lists.add(name=name, length=length)
            elif key == "breaks":
                spec.breaks.extend(self._text(each, key) for each in self._list(value, key))
            else:
                self._field(value, key, spec, key)
        return spec

    def _parameters(
        self,
        name: str,
        node: Any,
        found: dict[str, graph_pb2.ParameterValue],
        lists: dict[str, int],
        depth: int = 0,
    ) -> None:
        """Add the parameters that a value sets, as flat() of spec.py."""
        # Aliases may contain themselves, or each other many times.
        if depth > _DEEPEST:
            raise self._error(node, f"more than {_DEEPEST} mappings or lists in each other")
        if len(found) + len(lists) > _MOST_PARAMETERS:
            raise self._error(node, f"a component has more than {_MOST_PARAMETERS} parameters")
        if node.id != "mapping" and (name in found or name in lists):
            raise self._error(node, f"parameters.{name} is set twice")
        if node.id == "scalar":
            found[name] = self._value(node, f"parameters.{name}")
            return
        if node.id == "mapping":
            if not node.value:
                raise self._error(node, f"parameters.{name} is empty")
            for key, (_, member) in self._mapping(node, f"parameters.{name}").items():
                self._parameters(f"{name}/{key}", member, found, lists, depth + 1)
        else:
            lists[name] = len(node.value)
            for index, element in enumerate(node.value):
                self._parameters(f"{name}_{index}", element, found, lists, depth + 1)

    def _message(self, node: Any, where: str, message: Any) -> None:
        """Set the fields of a settings message by the keys of a mapping."""
        keys = self._mapping(node, where)
        fields = message.DESCRIPTOR.fields_by_name
        self._check_keys(keys, fields, f"of {where}")
        for key, (_, value) in keys.items():
            if fields[key].message_type is not None:
                self._message(value, f"{where}.{key}", getattr(message, key))
            elif fields[key].enum_type is not None:
                known = choices(fields[key].enum_type)
                text = self._text(value, f"{where}.{key}")
                if text not in known:
                    raise self._error(
                        value, f"{where}.{key} must be one of {', '.join(known)}, not {text}"
                    )
                setattr(message, key, known[text])
            else:
                self._field(value, f"{where}.{key}", message, key)

    def _field(self, node: Any, where: str, message: Any, key: str) -> None:
        expected = type(message.DESCRIPTOR.fields_by_name[key].default_value)
        value = self._scalar(node, where, expected)
        try:
            setattr(message, key, value)
        except ValueError:
            raise self._error(node, f"{where} is out of range: {value}") from None

    def _text(self, node: Any, where: str) -> str:
        return str(self._scalar(node, where, str))

    def _scalar(self, node: Any, where: str, expected: type) -> Any:
        parsed = self._value(node, where)
        value = getattr(parsed, parsed.WhichOneof("kind"))
        if expected is float and type(value) is int:
            value = float(value)
        if type(value) is not expected:
            hint = "; quote it" if expected is str else ""
            raise self._error(node, f"{where} must be {_WORDS[expected]}, not {node.value}{hint}")
        return value

    def _value(self, node: Any, where: str) -> graph_pb2.ParameterValue:
        if node.id != "scalar":
            raise self._error(node, f"{where} must be a single value, not a {node.id}")
        if node.style:  # quoted, or a block of text
            return graph_pb2.ParameterValue(string_value=node.value)
        if node.value in _NOTHING:
            raise self._error(node, f"{where} has no value; empty text is ''")
        try:
            return parse_value(node.value)
        except ValueError as error:
            raise self._error(node, f"{where}: {error}") from None

    def _list(self, node: Any, where: str) -> list[Any]:
        if node.id != "sequence":
            raise self._error(node, f"{where} must be a list")
        return list(node.value)

    def _mapping(self, node: Any, where: str) -> dict[str, tuple[Any, Any]]:
        """Return the nodes of key and value for each key."""
        if node.id != "mapping":
            raise self._error(node, f"{where} must be a mapping (key: value)")
        result: dict[str, tuple[Any, Any]] = {}
        for key, value in node.value:
            if key.id != "scalar":
                raise self._error(key, f"a key of {where} must be a single word")
            if key.value in result:
                raise self._error(key, f'key "{key.value}" occurs twice')
            result[key.value] = (key, value)
        return result

    def _check_keys(
        self, keys: dict[str, tuple[Any, Any]], known: Collection[str], where: str
    ) -> None:
        for name, (key, _) in keys.items():
            if name not in known:
                meant = suggestion(name, known, most=1)
                raise self._error(
                    key, f'unknown key "{name}" {where}{meant} (known: {", ".join(known)})'
                )

    def _error(self, node: Any, text: str) -> GraphFileError:
        return GraphFileError(f"{self._file}:{node.start_mark.line + 1}: {text}")
