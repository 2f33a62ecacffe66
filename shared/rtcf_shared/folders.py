"""Where component libraries are: the folders that rtcfd and local tools search.

A package is a folder of libraries, `<folder>/<package>/*.so`; of two types
with one name in a package the first found counts.
"""

import os
import sysconfig
from collections.abc import Iterator, Sequence
from pathlib import Path

# Of a prefix.  Its lib/rtcf is that of the programs of the ROS package rtcf: another one in a
# workspace would hide them.
PREFIX_FOLDER = "rtcf-components"


def component_folders(extra: Sequence[Path], build_tree: Path | None) -> list[Path]:
    """Return the folders that hold packages, the first ones win.

    Those named come first, then workspaces as catkin overlays them, then the
    build tree of rtcf itself, then the system.
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
    """Return where `rtcfctl load FILE.py` puts libraries; a user's private daemons look there."""
    cache = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(cache) if cache.startswith("/") else Path.home() / ".cache") / "rtcf-components"


def packages(folders: Sequence[Path]) -> dict[str, list[Path]]:
    """Return the libraries of each package, in the order in which they count."""
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
