"""Maps paths in libraries as for C++ objects, so that packages do not contain the build folder."""

import os
import shlex

_FLAGS = ("-ffile-prefix-map", "-fdebug-prefix-map")


def mapped(file: str) -> str:
    """Return the path of a file, mapped by flags in CXXFLAGS such as -ffile-prefix-map=/build/x=.

    The last matching flag wins, as in gcc.
    """
    for word in reversed(shlex.split(os.environ.get("CXXFLAGS", ""))):
        flag, _, rule = word.partition("=")
        old, _, new = rule.partition("=")
        if flag in _FLAGS and old and file.startswith(old):
            return new + file.removeprefix(old)
    return file
