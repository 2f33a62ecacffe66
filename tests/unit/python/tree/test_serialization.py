"""The executor serializes messages in one place, which makes their texts valid UTF-8."""

import re

from pages import TREE

_CALL = re.compile(r"[.>]Serialize(?:Partial)?(?:As|To)\w+\(")


def test_only_one_file_of_the_executor_serializes_messages() -> None:
    sources = [
        path
        for folder in ("executor", "ros")
        for suffix in ("*.cpp", "*.hpp")
        for path in (TREE / "daemon" / folder).rglob(suffix)
    ]
    callers = [str(path.relative_to(TREE)) for path in sources if _CALL.search(path.read_text())]
    assert callers == ["daemon/executor/common/serialized.cpp"], "call serialized() instead"
