"""The catalog: finds the library of a component type.

A package is a folder of libraries, `<folder>/<package>/*.so`, in one of the
folders of the search path.  If two libraries provide a type, the first one wins.
A library that does not load hides its package in later folders: rtcfd never
silently replaces the first folder's code by other code.
"""

import asyncio
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import errors_pb2, graph_pb2
from rtcf_shared.folders import packages
from rtcf_shared.naming import closest, listing, suggestion

from rtcfd.catalog.describe import Describer
from rtcfd.common import declared_values
from rtcfd.common.background import WorkerThreads
from rtcfd.common.errors import FailedPrecondition, NotFound
from rtcfd.common.names import check_base_name, full_name

_FOLDERS_TIMEOUT_S = 10.0


@dataclass(frozen=True)
class Folder:
    """A folder of packages.  If the settings name it, libraries of its owner are trusted."""

    path: Path
    named: bool = False

    def owner(self) -> int | None:
        """Return the uid whose libraries are trusted besides root's and our own, if any."""
        if not self.named:
            return None
        try:
            return self.path.stat().st_uid
        except OSError:
            return None


@dataclass(frozen=True)
class Library:
    """A library that provides a type."""

    path: str
    owner: int | None
    others: tuple[str, ...] = ()  # further libraries with the type, which are not used
    parameters: tuple[graph_pb2.ParameterInfo, ...] = ()  # declared by the type
    ports: tuple[graph_pb2.PortInfo, ...] = ()  # of the type

    def note(self, spec: graph_pb2.ComponentSpec) -> str:
        """Return a note if several libraries provide the type, else an empty string."""
        if not self.others:
            return ""
        return (
            f"several libraries provide {spec.package}/{spec.type}: rtcfd uses {self.path}, "
            f"not {', '.join(self.others)}"
        )

    def set_vector_sizes(self, spec: graph_pb2.ComponentSpec) -> None:
        """Set the vectors of a component that are given as lists; see declared_values.py."""
        declared_values.set_vector_sizes(full_name(spec), spec, self.parameters)

    def type_ports(self, type_name: str) -> wire.TypePorts:
        """Return the ports of its type."""
        output = graph_pb2.DIRECTION_OUTPUT
        return wire.TypePorts(
            library=self.path,
            type=type_name,
            inputs=[each.name for each in self.ports if each.direction != output],
            outputs=[each.name for each in self.ports if each.direction == output],
        )

    def load(self, spec: graph_pb2.ComponentSpec) -> wire.Load:
        """Return the request to load a component from this library, with its vectors' sizes."""
        load = wire.Load(component=spec, library=self.path, owner=self.owner)
        self.set_vector_sizes(load.component)
        return load


@dataclass
class _Contents:
    """The types in the libraries of a package."""

    types: dict[str, graph_pb2.ComponentType] = field(default_factory=dict)
    others: dict[str, list[str]] = field(default_factory=dict)  # by type, its further libraries
    hidden: dict[str, Path] = field(default_factory=dict)  # by type, its library in a later folder
    broken: Path | None = None  # the first library that does not load
    problems: list[str] = field(default_factory=list)


class Catalog:
    """Finds component types along the search path."""

    def __init__(self, folders: Sequence[Folder], describer: Describer) -> None:
        self.folders = list(folders)
        self._describer = describer
        # The folders may be on a server that does not answer.
        self._threads = WorkerThreads("folders of components")

    def look_again(self) -> None:
        """Forget the cached failures of libraries."""
        self._describer.forget_failures()

    async def find(self, package: str, type_name: str) -> Library:
        """Return the library of a type; raises NotFound or FailedPrecondition."""
        check_base_name("package", package)
        check_base_name("type", type_name)
        known = await self._packages()
        libraries = known.get(package)
        if libraries is None:
            raise NotFound(
                self._no_package(package, known),
                errors_pb2.REASON_PACKAGE_NOT_FOUND,
                package=package,
                suggestion=closest(package, known),
            )
        contents = await self._contents(package, libraries)
        found = contents.types.get(type_name)
        if found is not None:
            return Library(
                str(found.library),
                self._owner(Path(found.library)),
                tuple(contents.others.get(type_name, ())),
                tuple(found.parameters),
                tuple(found.ports),
            )
        if contents.problems:
            later = contents.hidden.get(type_name)
            text = (
                f'no type "{type_name}" in package "{package}" (types: {listing(contents.types)}), '
                "and some of its libraries do not load"
                if later is None
                else f"{package}/{type_name}: {contents.broken} does not load, and {later} in a "
                f"later folder does not replace it: repair or remove {contents.broken}"
            )
            raise FailedPrecondition(
                f"{text}: {'; '.join(contents.problems)}",
                errors_pb2.REASON_LIBRARY_REFUSED,
                package=package,
                type=type_name,
            )
        raise NotFound(
            f'no type "{type_name}" in package "{package}"'
            f"{suggestion(type_name, contents.types)} (types: {listing(contents.types)})",
            errors_pb2.REASON_TYPE_NOT_FOUND,
            package=package,
            type=type_name,
            suggestion=closest(type_name, contents.types),
        )

    async def types(self, package: str = "") -> tuple[list[graph_pb2.ComponentType], list[str]]:
        """Return the types of one package or of all, sorted by name, and the load errors."""
        known = await self._packages()
        if package:
            check_base_name("package", package)
            if package not in known:
                raise NotFound(
                    self._no_package(package, known),
                    errors_pb2.REASON_PACKAGE_NOT_FOUND,
                    package=package,
                    suggestion=closest(package, known),
                )
            known = {package: known[package]}
        names = sorted(known)
        every = await asyncio.gather(*(self._contents(name, known[name]) for name in names))
        types = [contents.types[name] for contents in every for name in sorted(contents.types)]
        return types, [problem for contents in every for problem in contents.problems]

    async def _contents(self, package: str, libraries: list[Path]) -> _Contents:
        contents = _Contents()
        descriptions = await asyncio.gather(
            *(
                self._describer.describe(library, package, self._owner(library))
                for library in libraries
            )
        )
        for library, description in zip(libraries, descriptions, strict=True):
            if description.problem:
                contents.problems.append(_one_problem(library, description.problem))
                contents.broken = contents.broken or library
            hidden = contents.broken is not None and contents.broken.parent != library.parent
            for described in description.types:
                if hidden and described.type not in contents.types:
                    contents.hidden.setdefault(described.type, library)
                    continue
                offered = graph_pb2.ComponentType()
                offered.CopyFrom(described)
                offered.package = package
                offered.library = str(library)
                if contents.types.setdefault(offered.type, offered) is not offered:
                    contents.others.setdefault(offered.type, []).append(str(library))
        return contents

    async def _packages(self) -> dict[str, list[Path]]:
        folders = [folder.path for folder in self.folders]
        return await self._threads.run(lambda: packages(folders), _FOLDERS_TIMEOUT_S)

    def _owner(self, library: Path) -> int | None:
        """Return the owner() of the folder with a library's package."""
        for folder in self.folders:
            if folder.path == library.parents[1]:
                return folder.owner()
        return None

    def _no_package(self, package: str, known: Iterable[str]) -> str:
        folders = ", ".join(str(folder.path) for folder in self.folders)
        return (
            f'no package "{package}" with component libraries in {folders}'
            f"{suggestion(package, known)}"
        )


async def loads(catalog: Catalog, specs: Iterable[graph_pb2.ComponentSpec]) -> list[wire.Load]:
    """Return the requests to load components; each type is looked up once."""
    return list((await whole_graph(catalog, specs)).components)


async def whole_graph(
    catalog: Catalog, specs: Iterable[graph_pb2.ComponentSpec], *, dry_run: bool = False
) -> wire.Apply:
    """Return the request to make a graph consist of components; each type is looked up once."""
    libraries: dict[tuple[str, str], Library] = {}
    apply = wire.Apply(dry_run=dry_run)
    for spec in specs:
        key = (spec.package, spec.type)
        if key not in libraries:
            libraries[key] = await catalog.find(*key)
            apply.types.append(libraries[key].type_ports(spec.type))
        apply.components.append(libraries[key].load(spec))
    return apply


def _one_problem(library: Path, problem: str) -> str:
    """Put the library's path before a problem, unless the dynamic loader's text has it already."""
    text = " ".join(problem.split())
    return text if str(library) in text else f"{library}: {text}"
