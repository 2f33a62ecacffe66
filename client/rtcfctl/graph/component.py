"""`rtcfctl load|unload|replace|release|list|info`."""

import argparse
import sys
from collections.abc import Iterable
from contextlib import ExitStack
from typing import Any

import rtcf
from rtcf.v1 import control_pb2, graph_pb2
from rtcf_shared.naming import listing, suggestion

from rtcfctl.graph import python_source
from rtcfctl.graph.compiler import Compiler
from rtcfctl.terminal import words
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.plain import enumerator

_POLLS_PER_CHECK = 5  # comparisons of a watched source per check that its component still exists
_STYLES = {
    graph_pb2.COMPONENT_STATE_FAULTED: "bold red",
    graph_pb2.COMPONENT_STATE_LEFT_OUT: "bold red",
    graph_pb2.COMPONENT_STATE_STUCK: "bold red",
}


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verbs."""
    loading = verbs.add_parser("load", parents=[common], help="load a component")
    _component_options(loading)
    loading.add_argument("--wait", action="store_true", help="wait for a ROS master if needed")
    loading.add_argument(
        "--watch",
        action="store_true",
        help="with FILE.py: reload the component whenever the file is saved, until Ctrl-C",
    )
    loading.set_defaults(run=load)

    unloading = verbs.add_parser("unload", parents=[common], help="unload components")
    unloading.add_argument("names", metavar="NAME", nargs="+")
    unloading.add_argument(
        "--force",
        action="store_true",
        help="if a hook does not return, end the loop and its executor; load the rest of the graph "
        "into a new one",
    )
    unloading.set_defaults(run=unload)

    replacing = verbs.add_parser(
        "replace", parents=[common], help="replace a component by a new one"
    )
    replacing.add_argument("old", metavar="NAME")
    replacing.add_argument(
        "--rebuilt",
        action="store_true",
        help="use its own type, from the present file of its library",
    )
    _component_options(replacing, needed=False)
    replacing.add_argument(
        "--reset-parameters",
        action="store_true",
        help="start with default parameters instead of the old component's",
    )
    replacing.set_defaults(run=replace)

    releasing = verbs.add_parser(
        "release", parents=[common], help="load components again that were left out after a fault"
    )
    releasing.add_argument("names", metavar="NAME", nargs="+")
    releasing.set_defaults(run=release)

    listing = verbs.add_parser("list", parents=[common], help="list all components")
    listing.set_defaults(run=show_all)

    info = verbs.add_parser(
        "info", parents=[common], help="show one component, with values, or a component type"
    )
    info.add_argument("component", metavar="NAME", nargs="?", default="")
    info.add_argument(
        "--type",
        default="",
        metavar="PKG/COMPONENT",
        help="describe this type, which need not be loaded: ports, parameters, units, state",
    )
    info.set_defaults(run=show)


def load(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Load a component."""
    if args.watch and not python_source.is_source(args.package):
        raise ValueError("--watch requires a Python source: rtcfctl load FILE.py COMPONENT --watch")
    with ExitStack() as ends:
        if args.watch:
            changes = python_source.changes(args.package)
            compiler = ends.enter_context(python_source.warm_compiler(args.build_tree))
            spec = _spec(args, output, compiler)
        else:
            spec = _spec(args, output)
        with python_source.found_by_rtcfd(args.package):
            result = client.load(spec, args.runner, output.progress, wait=args.wait)
        output.changed(f"loaded {result.component}", result)
        if args.watch:
            sys.stdout.flush()
            watch(client, args, output, result.component, changes, compiler)


def watch(
    client: rtcf.Client,
    args: argparse.Namespace,
    output: Output,
    name: str,
    changes: Iterable[bool],
    compiler: Compiler,
) -> None:
    """Replace a component whenever its Python source is saved."""
    for at, saved in enumerate(changes):
        if at % _POLLS_PER_CHECK == 0:
            _require(client, args.runner, name)
        if not saved:
            continue
        try:
            spec = _spec(args, output, compiler)
            # As the command line does not change, tuned parameters keep their values.
            with python_source.found_by_rtcfd(args.package):
                result = client.replace(name, spec, args.runner, output.progress, given_before=spec)
        except (rtcf.RefusedError, python_source.NotCompiledError) as error:
            # The loop continues with the present component.
            output.error(error)
        else:
            output.changed(f"reloaded {name} from {args.package}{_kept(result)}", result)
            sys.stdout.flush()


def _require(client: rtcf.Client, runner: str, name: str) -> None:
    """Raise RefusedError if the component or its runner does not exist any more."""
    try:
        client.get_component(name, runner)
    except rtcf.DaemonUnreachableError:
        pass  # rtcfd is being restarted
    except rtcf.RefusedError as refused:
        if refused.code == "NOT_FOUND":
            raise


def unload(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Unload components."""
    result = client.unload(args.names, args.runner, output.progress, force=args.force)
    output.changed(f"unloaded {', '.join(args.names)}", result)


def replace(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Replace a component."""
    if args.rebuilt == bool(args.type):
        raise ValueError("replace: specify PKG COMPONENT or --rebuilt")
    spec = _spec(args, output)
    with python_source.found_by_rtcfd(args.package):
        result = client.replace(
            args.old, spec, args.runner, output.progress, reset_parameters=args.reset_parameters
        )
    output.changed(f"replaced {args.old} by {result.component}{_kept(result)}", result)


def _kept(result: control_pb2.ChangeResult) -> str:
    kept = ", ".join(f"{each.name} {words.value(each.value)}" for each in result.kept)
    return f"; kept {kept}" if kept else ""


def release(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Load components again."""
    result = client.release(args.names, args.runner, output.progress)
    output.changed(f"released {', '.join(args.names)}", result)


def show_all(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print all components in the order in which they run."""
    components = client.list_components(args.runner)
    if not output.for_people:
        output.data(components)
        return
    output.table(
        ("#", "component", "type", "state", "notes"),
        (
            (
                "-" if _not_loaded(each) else each.position,
                each.full_name,
                f"{each.spec.package}/{each.spec.type}" if each.spec.package else "-",
                (enumerator(each, "state").replace("_", " "), _STYLES.get(each.state, "")),
                ", ".join(
                    filter(None, (_notes(each.spec, each.holder), _changed(each), _fault(each)))
                ),
            )
            for each in components
        ),
        right=("#",),
    )


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print one component, or one type."""
    if bool(args.type) == bool(args.component):
        raise ValueError("info: specify NAME or --type PKG/COMPONENT")
    if args.type:
        show_type(client, args.type, output)
        return
    found = client.get_component(args.component, args.runner)
    if not output.for_people:
        output.data(found)
        return
    code = f": {found.spec.package}/{found.spec.type}" if found.spec.package else ""
    output.line(f"{found.full_name}{code}", "bold")
    if found.doc:
        output.line(f"  {found.doc}")
    if _not_loaded(found):
        how = "left out of the loop" if left_out(found) else enumerator(found, "state")
        output.line(f"  {how}: {found.fault}", "bold red")
        return
    output.line(f"  {enumerator(found, 'state')}, position {found.position} in the order")
    output.line(f"  from {found.library}")
    if found.library_changed:
        output.line(
            "  this file has changed since the component was loaded: "
            f"`rtcfctl replace {found.full_name} --rebuilt` loads it",
            "yellow",
        )
    if found.fault:
        output.line(f"  fault: {_fault(found)}", "bold red")
    if notes := _notes(found.spec, found.holder):
        output.line(f"  {notes}")
    _print_members(found, output)


def show_type(client: rtcf.Client, name: str, output: Output) -> None:
    """Print one component type of a package."""
    package, _, type_name = name.partition("/")
    if not (package and type_name) or "/" in type_name:
        raise ValueError(f"--type {name}: must be PKG/COMPONENT, e.g. rtcf_examples/Mimo")
    response = client.list_types(package)
    types = {each.type: each for each in response.types}
    if type_name not in types:
        problems = "".join(f"; cannot be loaded: {each}" for each in response.problems)
        raise rtcf.RtcfError(
            f'no type "{type_name}" in package "{package}"{suggestion(type_name, types)} '
            f"(types: {listing(types)}){problems}"
        )
    found = types[type_name]
    if not output.for_people:
        output.data(found)
        return
    output.line(f"{found.package}/{found.type}", "bold")
    if found.doc:
        output.line(f"  {found.doc}")
    output.line(f"  from {found.library}")
    _print_members(found, output, of_type=True)


def _print_members(
    found: graph_pb2.ComponentInfo | graph_pb2.ComponentType,
    output: Output,
    *,
    of_type: bool = False,
) -> None:
    """Print ports, parameters and declared state, as far as there are any."""
    if found.ports:
        print_ports(list(found.ports), output)
    if found.parameters:
        print_parameters(list(found.parameters), output, of_type=of_type)
    if found.states:
        print_states(list(found.states), output, of_type=of_type)


def print_ports(ports: list[graph_pb2.PortInfo], output: Output) -> None:
    """Print ports with mapped names, types and newest values."""
    output.table(
        ("port", "", "mapped name", "type", "value", "unit", "age", "", "meaning"),
        (
            (
                port.name,
                enumerator(port, "direction").removesuffix("put"),
                port.mapped_name,
                port.type,
                words.port_value(port.value) if port.HasField("value") else "",
                port.unit,
                words.age(port.age_ns) if port.HasField("age_ns") else "",
                _flags(port),
                port.doc,
            )
            for port in ports
        ),
        right=("age",),
    )


def print_parameters(
    parameters: list[graph_pb2.ParameterInfo], output: Output, *, of_type: bool = False
) -> None:
    """Print parameters with bounds, and with values unless they are those of a type."""
    output.table(
        ("parameter", "type", "value", "unit", "range", "default", "meaning"),
        (
            (
                each.name,
                each.type,
                "" if of_type else words.value(each.value),
                each.unit,
                _range(each),
                words.value(each.default_value),
                each.doc,
            )
            for each in parameters
        ),
    )


def print_states(
    states: list[graph_pb2.StateInfo], output: Output, *, of_type: bool = False
) -> None:
    """Print declared state, with values unless it is that of a type."""
    output.table(
        ("state", "type", "value", "unit", "initial", "meaning"),
        (
            (
                each.name,
                each.type,
                "" if of_type else each.value or "-",
                each.unit,
                each.initial,
                each.doc,
            )
            for each in states
        ),
    )


def left_out(found: graph_pb2.ComponentInfo) -> bool:
    """Return whether a component of the graph is not loaded."""
    return bool(found.state == graph_pb2.COMPONENT_STATE_LEFT_OUT)


def _not_loaded(found: graph_pb2.ComponentInfo) -> bool:
    """Return whether a component has no place in the loop."""
    stuck = found.state == graph_pb2.COMPONENT_STATE_STUCK
    return left_out(found) or (stuck and not found.library)


def _component_options(to: argparse.ArgumentParser, needed: bool = True) -> None:
    maybe: dict[str, Any] = {} if needed else {"nargs": "?", "default": ""}
    to.add_argument("package", metavar="PKG", help="package, or FILE.py to compile", **maybe)
    to.add_argument("type", metavar="COMPONENT", help="component type of the package", **maybe)
    python_source.add_option(to)
    to.add_argument("--name", default="", help="set its name (default: the type's name)")
    to.add_argument("--ns", default="", help="set its namespace (default: /)")
    to.add_argument("--remap", action="append", default=[], metavar="FROM:=TO")
    to.add_argument("--param", action="append", default=[], metavar="NAME:=VALUE")
    to.add_argument("--first", action="store_true", help="make all connections into it loop breaks")
    to.add_argument(
        "--ignore",
        default="",
        metavar="REGEX",
        help="make connections into it loop breaks if their whole mapped name matches",
    )
    to.add_argument(
        "--break",
        dest="breaks",
        action="append",
        default=[],
        metavar="PORT",
        help="make the connection into this input a loop break",
    )
    to.add_argument(
        "--every", type=words.whole, default=0, metavar="N", help="run in each N-th cycle"
    )
    to.add_argument(
        "--phase",
        type=words.whole,
        metavar="N",
        help="with --every: first cycle in which it runs, from 0 (default: spreads the load)",
    )
    to.add_argument(
        "--optional", action="store_true", help="continue the loop without it after a fault"
    )


def _spec(
    args: argparse.Namespace, output: Output, compiler: Compiler | None = None
) -> graph_pb2.ComponentSpec:
    package = args.package
    if python_source.is_source(package):
        package = python_source.compiled(
            package, args.build_tree, output.begin, not args.no_verify, compiler
        )
    return rtcf.component(
        package,
        args.type,
        name=args.name,
        ns=args.ns,
        remaps=args.remap,
        parameters=args.param,
        first=args.first,
        ignore=args.ignore,
        breaks=args.breaks,
        every=args.every,
        phase=args.phase,
        optional=args.optional,
    )


def _notes(spec: graph_pb2.ComponentSpec, holder: str) -> str:
    notes = ["first"] if spec.first else []
    if spec.ignore:
        notes.append(f"ignores {spec.ignore}")
    if spec.breaks:
        notes.append(f"loop break at {', '.join(spec.breaks)}")
    if spec.every > 1:
        phase = f" from cycle {spec.phase}" if spec.HasField("phase") else ""
        notes.append(f"every {spec.every} cycles{phase}")
    if spec.optional:
        notes.append("optional")
    if holder:
        notes.append(f"held by {holder}")
    return ", ".join(notes)


def _changed(found: graph_pb2.ComponentInfo) -> str:
    return "library changed" if found.library_changed else ""


def _fault(found: graph_pb2.ComponentInfo) -> str:
    return found.fault + (f" ({found.faults} in all)" if found.faults > 1 else "")


def _flags(port: graph_pb2.PortInfo) -> str:
    flags = (
        (port.mapped_name and not port.connected and not port.mapped, "open"),
        (port.broken, "loop break"),
        (port.mapped, "ROS"),
    )
    return " ".join(word for condition, word in flags if condition)


def _range(found: graph_pb2.ParameterInfo) -> str:
    return " ".join(filter(None, (_bounds(found), "fixed" if found.fixed else "")))


def _bounds(found: graph_pb2.ParameterInfo) -> str:
    if found.choices:
        return "|".join(found.choices)
    low = f"{found.minimum:g}" if found.HasField("minimum") else ""
    high = f"{found.maximum:g}" if found.HasField("maximum") else ""
    return f"{low}..{high}" if low or high else ""
