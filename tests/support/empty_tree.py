"""A source tree without tests, in which pytest runs as in this one."""

import shutil
from pathlib import Path

from pages import TREE


def make_empty_tree(folder: Path) -> Path:
    """Copy what pytest reads in this tree to a folder; return it."""
    (folder / "tests" / "support").mkdir(parents=True)
    plugins = ("any_processor", "failures_at_once", "forking", "random_share", "time_table")
    for name in ("conftest.py", *(f"support/{each}.py" for each in plugins)):
        shutil.copy(TREE / "tests" / name, folder / "tests" / name)
    shutil.copy(TREE / "pyproject.toml", folder)
    compiler = folder / "build" / "python" / "rtcf_compile"
    compiler.mkdir(parents=True)
    for name in ("__init__.py", "instructions.py"):
        shutil.copy(TREE / "components" / "python" / "rtcf_compile" / name, compiler)
    return folder
