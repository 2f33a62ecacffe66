"""docs/troubleshooting.md explains messages that there are."""

import re
from pathlib import Path

import pytest

TREE = Path(__file__).parents[3]
MESSAGES = re.findall(
    r"^\| `([^`]+)` \|", (TREE / "docs" / "troubleshooting.md").read_text(), re.MULTILINE
)
_CODE = [
    *(TREE / "daemon").rglob("*.py"),
    *(TREE / "daemon").rglob("*.cpp"),
    *(TREE / "client").rglob("*.py"),
]


@pytest.fixture(scope="module")
def texts() -> str:
    """Give what the code says, with texts that go over several lines joined."""
    return "\n".join(re.sub(r'"\s*\n\s*f?"', "", file.read_text()) for file in _CODE)


def test_there_are_messages() -> None:
    assert len(MESSAGES) == len(set(MESSAGES)) > 20


@pytest.mark.parametrize("message", MESSAGES)
def test_a_message_is_one_that_is_said(texts: str, message: str) -> None:
    assert message in texts
