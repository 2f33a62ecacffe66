"""Paths in libraries, mapped as in C++ objects: packages do not name the folder of their build."""

import os
import shlex

_FLAGS = ("-ffile-prefix-map", "-fdebug-prefix-map")


def mapped(file: str) -> str:
    """Return a file's path as flags of CXXFLAGS map it: -ffile-prefix-map=/build/x=. for instance.

    The last one that fits counts, as for gcc.
    """
    for word in reversed(shlex.split(os.environ.get("CXXFLAGS", ""))):
        flag, _, rule = word.partition("=")
        old, _, new = rule.partition("=")
        if flag in _FLAGS and old and file.startswith(old):
            return new + file.removeprefix(old)
    return file
