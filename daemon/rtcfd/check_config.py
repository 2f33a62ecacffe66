"""Checks the settings and graphs.d without a daemon: `rtcfd --check-config`.

As root, the check of the service takes its user, so that it finds what this user cannot read, and
asks systemd which folders its sandbox lets it write.
"""

import asyncio
import logging
import os
import pwd
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rtcf.v1 import graph_pb2

from rtcfd.catalog.catalog import Catalog
from rtcfd.catalog.describe import Describer
from rtcfd.common import declared_values
from rtcfd.common.errors import RequestError
from rtcfd.common.names import full_name
from rtcfd.configuration import options
from rtcfd.configuration.options import Options
from rtcfd.configuration.settings_file import unwritable
from rtcfd.state.boot_graphs import BootGraph, BootGraphs

_UNIT = "rtcfd.service"
_TIMEOUT_S = 10.0  # for systemd


@dataclass(frozen=True)
class Unit:
    """The part of the service's unit that decides what rtcfd may read and write."""

    user: str
    writable: tuple[Path, ...]
    sandboxed: bool  # all other folders are read-only

    def error(self, key: str, folder: Path) -> str:
        """Return why the service cannot write to a folder of the settings; empty = it can."""
        if any(folder.is_relative_to(each) for each in self.writable):
            return ""
        if self.sandboxed:
            permit = (
                f"StateDirectory=rtcfd {folder.relative_to('/var/lib')}"
                if folder.is_relative_to("/var/lib")
                else f"ReadWritePaths={folder}"
            )
            return (
                f"daemon.{key}: {folder} is read-only in the sandbox of {_UNIT}: `systemctl edit "
                f"rtcfd` with {permit} under [Service] permits it"
            )
        why = unwritable(folder)
        return why and f"daemon.{key}: {why}"


def installed_unit() -> Unit | None:
    """Return the service's unit, from systemd; None if there is none."""
    names = "LoadState,User,ProtectSystem,StateDirectory,RuntimeDirectory,ReadWritePaths"
    try:
        shown = subprocess.run(
            ["systemctl", "show", _UNIT, f"--property={names}"],
            capture_output=True, text=True, timeout=_TIMEOUT_S, check=False,
        ).stdout  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None
    return unit_of(shown)


def unit_of(shown: str) -> Unit | None:
    """Return the unit that `systemctl show` describes; None if it is not installed."""
    values = dict(line.split("=", 1) for line in shown.splitlines() if "=" in line)
    if values.get("LoadState") != "loaded":
        return None

    def paths(key: str, folder: str) -> Iterable[Path]:
        for each in values.get(key, "").split():
            yield Path(folder, each.partition(":")[0].lstrip("-+"))

    return Unit(
        values.get("User") or "root",
        (
            *paths("StateDirectory", "/var/lib"),
            *paths("RuntimeDirectory", "/run"),
            *paths("ReadWritePaths", "/"),
        ),
        values.get("ProtectSystem") == "strict",
    )


def _become(user: str) -> None:
    """Take the ids of a user.  Root only; for the rest of this process."""
    found = pwd.getpwnam(user)
    os.setgroups(os.getgrouplist(user, found.pw_gid))
    os.setgid(found.pw_gid)
    os.setuid(found.pw_uid)


def check(arguments: Sequence[str] | None, build_tree: Path | None) -> list[str]:
    """Return the errors, a line each.  Raises RequestError for a bad settings file."""
    logging.getLogger("rtcfd").addHandler(logging.NullHandler())  # the errors are returned
    unit = installed_unit() if options.checks_service(arguments) else None
    if unit is not None and os.geteuid() == 0:
        _become(unit.user)
    elif unit is not None and pwd.getpwuid(os.geteuid()).pw_name != unit.user:
        print(
            f"rtcfd: note: run it as root to check what user {unit.user} may read and write",
            file=sys.stderr,
        )
    given = options.parse(arguments, build_tree)
    graphs, problems = BootGraphs(given.graphs_dir, {}, given.settings_error).read()
    if unit is not None:
        problems += _folder_errors(unit, given)
    for name in given.access.unknown():
        kind, plain = ("group", name[1:]) if name.startswith("@") else ("user", name)
        problems.append(f"[access] names the unknown {kind} {plain}: correct the name, or add it")
    return problems + asyncio.run(_component_errors(given, graphs))


def _folder_errors(unit: Unit, given: Options) -> list[str]:
    # rtcfd writes to folders in its runtime folder, which belongs to root.
    folders = {"state_dir": given.state_dir, "runtime_dir": given.runtime_dir / "executors"}
    found = (unit.error(key, folder) for key, folder in folders.items() if folder is not None)
    return [each for each in found if each]


async def _component_errors(given: Options, graphs: Iterable[BootGraph]) -> list[str]:
    """Return the errors of the types and parameters of graphs."""
    catalog = Catalog(given.folders, Describer(given.executor))
    errors: list[str] = []
    for graph in graphs:
        for spec in graph.graph.components:
            try:
                await _check_component(catalog, spec)
            except RequestError as error:
                name = full_name(spec)
                where = "" if str(error).startswith(name) else f"{name}: "
                errors.append(f"{graph.file}: {where}{error}")
    return errors


async def _check_component(catalog: Catalog, given: graph_pb2.ComponentSpec) -> None:
    library = await catalog.find(given.package, given.type)
    spec = library.load(given).component
    declared = {each.name: each for each in library.parameters}
    for each in spec.parameters:
        declared_values.check(full_name(spec), each, declared)
