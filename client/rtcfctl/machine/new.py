"""`rtcfctl new`: creates a package with a component, a build file, a test and a graph file."""

import argparse
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import rtcf

from rtcfctl.machine import templates
from rtcfctl.terminal.output import Output

_PACKAGE = re.compile(r"[a-z][a-z0-9_]*[a-z0-9]")
_COMPONENT = re.compile(r"[A-Z][A-Za-z0-9]*")
# Names of targets of CMake and catkin.
_TARGETS = {"all", "clean", "doxygen", "edit_cache", "help", "install", "list_install_components",
            "package", "rebuild_cache", "rtcf", "run_tests", "test", "tests"}  # fmt: skip


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    new = verbs.add_parser(
        "new", parents=[common], help="create a package with a component, its build and its test"
    )
    new.add_argument("package", metavar="NEW_PACKAGE", help="name and folder of the package")
    new.add_argument("type", metavar="NEW_COMPONENT", help="class of the component, e.g. LowPass")
    new.add_argument("--python", action="store_true", help="use Python instead of C++")
    new.set_defaults(run=run)


def run(_: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Create the folder atomically, and print the next commands."""
    name = _name_of(args.type)
    _check(args.package, args.type, name, args.python)
    folder = Path(args.package)
    made = templates.files(args.package, args.type, name, args.python)
    try:
        with tempfile.TemporaryDirectory(prefix=f".{folder}-", dir=".") as begun:
            whole = Path(begun) / folder
            for path, text in made.items():
                (whole / path).parent.mkdir(parents=True, exist_ok=True)
                (whole / path).write_text(text)
            if folder.exists() or folder.is_symlink():
                raise ValueError(f"{folder} exists: choose another name, or move it")
            whole.rename(folder)
    except OSError as error:
        raise rtcf.RtcfError(f"{folder}: {error.strerror or error}") from None
    if not output.for_people:
        output.data({"folder": str(folder.absolute()), "files": sorted(made)})
        return
    output.line(f"created {folder}/:")
    for path in sorted(made):
        output.line(f"- {path}")
    needs = "rtcf-python python3-pytest" if args.python else "librtcf-dev libgtest-dev"
    output.line(f"build and test it (apt install {needs}):")
    output.line(f"  cd {folder}")
    output.line("  cmake -S . -B build && cmake --build build")
    output.line("  ctest --test-dir build")
    output.line("run it until Ctrl-C (reloads after each build), query it from another terminal:")
    output.line("  rtcfctl --socket /tmp/rtcf.sock run graph.yaml")
    output.line("  rtcfctl --socket /tmp/rtcf.sock status")


def _name_of(component: str) -> str:
    """Return LowPass as low_pass, PDController as pd_controller."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", component)
    return words.lower()


def _check(package: str, component: str, name: str, python: bool) -> None:
    if not _PACKAGE.fullmatch(package) or "__" in package or len(package) > 100:
        raise ValueError(f"package {package!r}: use lower-case letters, digits and _, e.g. my_arm")
    if package in _TARGETS:
        raise ValueError(f"package {package}: CMake has a target of this name; choose another")
    if not _COMPONENT.fullmatch(component) or len(component) > 100:
        raise ValueError(
            f"component {component!r}: use letters and digits with a capital first, e.g. LowPass"
        )
    if component in templates.TAKEN:
        raise ValueError(f"component {component}: rtcf has a class of this name; choose another")
    if python and (name in sys.stdlib_module_names or name in ("numpy", "rtcf", "pytest")):
        raise ValueError(
            f"component {component}: its module {name}.py would hide Python's module {name}; "
            "choose another name"
        )
