"""A use of a possibly unassigned variable is reported with its line; other uses are accepted."""

import ast
from typing import Any

import pytest
from rtcf_compile.source.assigned import check_assigned
from rtcf_compile.source.mistake import Mistake
from rtcf_compile.source.modules import Source

ALWAYS = {
    "both ways": "if c:\n    x = 1\nelse:\n    x = 2\nreturn x",
    "the other way ends": "if c:\n    x = 1\nelse:\n    return 0\nreturn x",
    "a loop that runs": "for i in range(3):\n    x = i\nreturn x + i",
    "elements": "for i in (1, 2):\n    x = i\nreturn x",
    "before a break": "while True:\n    x = 1\n    if c:\n        break\nreturn x",
    "a condition": "if (x := c) > 1:\n    return x\nreturn x",
    "all of a condition": "if c and (x := c) > 1:\n    return x\nreturn 0",
    "none of a condition": "if not c or (x := c) > 1:\n    return 0\nreturn x",
    "while it holds": "while c and (x := c):\n    c = x\nreturn c",
    "all cases": "match c:\n    case 1:\n        x = 1\n    case _:\n        x = 2\nreturn x",
    "a case's own": "match c:\n    case 1:\n        x = 1\n    case x:\n        pass\nreturn x",
    "the end of a loop": "for i in range(c):\n    pass\nelse:\n    x = 1\nreturn x",
    "a fault": "if c:\n    x = 1\nelse:\n    c.fault('no')\nreturn x",
    "several": "x, (y, z) = c\nreturn x + y + z",
}
NOT_ALWAYS = {
    "one way": ("if c:\n    x = 1\nreturn x", 3),
    "a loop of any length": ("for i in range(c):\n    x = i\nreturn x", 3),
    "its variable": ("for i in range(c):\n    pass\nreturn i", 3),
    "after a continue": (
        "for i in range(3):\n    if i:\n        continue\n    x = i\nreturn x",
        5,
    ),
    "after a break": ("while True:\n    if c:\n        break\n    x = 1\nreturn x", 5),
    "behind and": ("a = c and (x := c)\nreturn x", 2),
    "any of a condition": ("if c or (x := c) > 1:\n    return x\nreturn 0", 2),
    "one case": ("match c:\n    case 1:\n        x = 1\nreturn x", 4),
    "itself": ("x += 1\nreturn x", 1),
    "the loop was left": (
        "for i in range(c):\n    if i:\n        break\nelse:\n    x = 1\nreturn x",
        6,
    ),
    "in an index": ("if c:\n    i = 1\nc[i] = 2", 3),
}


def source(body: str) -> Source:
    text = "def f(c):\n" + "\n".join(f"    {line}" for line in body.split("\n"))
    tree = ast.parse(text)
    scope: dict[str, Any] = {}
    exec(compile(tree, "f.py", "exec"), scope)
    function = tree.body[0]
    assert isinstance(function, ast.FunctionDef)
    return Source(scope["f"], function, "f.py")


@pytest.mark.parametrize("name", ALWAYS)
def test_variables_assigned_on_every_path_are_accepted(name: str) -> None:
    check_assigned(source(ALWAYS[name]))


@pytest.mark.parametrize("name", NOT_ALWAYS)
def test_possibly_unassigned_variables_are_rejected_with_their_line(name: str) -> None:
    body, line = NOT_ALWAYS[name]
    with pytest.raises(Mistake, match="may have no value here") as refused:
        check_assigned(source(body))
    assert refused.value.line == line + 1
