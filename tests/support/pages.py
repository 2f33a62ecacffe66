"""The commands of README, docs and manual pages, for the tests that run them."""

import re
import shlex
from pathlib import Path

TREE = Path(__file__).parents[2]
README = TREE / "README.md"
SUPPORT = Path(__file__).parent
MANUALS = TREE / "docs" / "man"


def shell_lines(text: str) -> list[str]:
    """Return the commands in the shell blocks of a page, comments and continuations resolved."""
    blocks = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.strip() and not line.startswith("#")]


def block(page: str, language: str, holding: str) -> str:
    """Return the block of README.md or of a page in docs/ that contains a text."""
    text = (README if page == "README.md" else TREE / "docs" / page).read_text()
    blocks = re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    (found,) = (str(each) for each in blocks if holding in each)
    return found


def section(page: Path, title: str) -> str:
    """Return one section of a page."""
    found = page.read_text().partition(f"## {title}\n")[2].partition("\n## ")[0]
    assert found, f"{page} has no section {title}"
    return found


def tour() -> list[list[str]]:
    """Return the words of each command of rtcfctl in README's tour."""
    return _of_rtcfctl(shell_lines(section(README, "A tour")))


def example(manual: str) -> str:
    """Return the example of a manual page."""
    text = (MANUALS / manual).read_text()
    found = re.search(r"^\.SH EXAMPLE\n\.nf\n(.*?)^\.fi", text, re.MULTILINE | re.DOTALL)
    assert found, f"{manual} has no example"
    return found[1].replace("\\-", "-").replace("\\(aq", "'").replace("\\e", "\\")


def commands(manual: str) -> list[list[str]]:
    """Return the words of each command of rtcfctl in the example of a manual page."""
    return _of_rtcfctl(example(manual).splitlines())


def _of_rtcfctl(lines: list[str]) -> list[list[str]]:
    found = [shlex.split(line, comments=True) for line in lines]
    return [words for words in found if words[:1] == ["rtcfctl"]]
