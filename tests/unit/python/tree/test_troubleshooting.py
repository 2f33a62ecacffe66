"""docs/troubleshooting.md explains existing messages."""

import re

import pytest
from pages import TREE

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
    """Return the texts of the code, with multi-line texts joined."""
    return "\n".join(re.sub(r'"\s*\n\s*f?"', "", file.read_text()) for file in _CODE)


def test_the_page_has_messages() -> None:
    assert len(MESSAGES) == len(set(MESSAGES)) > 20


@pytest.mark.parametrize("message", MESSAGES)
def test_a_message_of_the_page_exists_in_the_code(texts: str, message: str) -> None:
    assert message in texts
