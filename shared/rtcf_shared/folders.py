"""The folders of component libraries that rtcfd and local tools search.

A package is a folder of libraries, `<folder>/<package>/*.so`.  If two libraries of a
package provide a type, the first one wins.
"""

import os
import sysconfig
from collections.abc import Iterator, Sequence
from pathlib import Path

# In <prefix>/lib.  Not lib/rtcf, which has the programs of the ROS package rtcf: a folder of that
# name in a workspace would hide them.
PREFIX_FOLDER = "rtcf-components"


def component_folders(extra: Sequence[Path], build_tree: Path | None) -> list[Path]:
    """Return the folders of packages, in the order of the search.

    `extra` comes first, then the workspaces in the order of catkin's overlays, then the
    build tree of rtcf, then the system.
    """
    folders = list(extra)
    for prefix in os.environ.get("CMAKE_PREFIX_PATH", "").split(os.pathsep):
        if prefix.startswith("/"):
            folders.append(Path(prefix) / "lib" / PREFIX_FOLDER)
    if build_tree is not None:
        folders.append(build_tree / "lib" / "rtcf")
    triplet = sysconfig.get_config_var("MULTIARCH")
    if triplet:
        folders.append(Path("/usr/lib") / triplet / "rtcf")
    folders.append(Path("/usr/lib") / PREFIX_FOLDER)
    return list(dict.fromkeys(Path(os.path.abspath(folder)) for folder in folders))


def compiled_folder() -> Path:
    """Return the folder for libraries compiled by `rtcfctl load FILE.py`, which private daemons
    of the same user search."""
    cache = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(cache) if cache.startswith("/") else Path.home() / ".cache") / "rtcf-components"


def packages(folders: Sequence[Path]) -> dict[str, list[Path]]:
    """Return the libraries of each package, in the order of the search."""
    found: dict[str, list[Path]] = {}
    for folder in folders:
        for package in _sub_folders(folder):
            libraries = sorted(package.glob("*.so"))
            if libraries:
                found.setdefault(package.name, []).extend(libraries)
    return found


def _sub_folders(folder: Path) -> Iterator[Path]:
    try:
        yield from sorted(entry for entry in folder.iterdir() if entry.is_dir())
    except OSError:
        return  # a folder of the search path need not exist
