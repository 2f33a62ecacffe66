"""tools/check-words: one word for one thing."""

import subprocess
from pathlib import Path

import pytest
from pages import TREE


def check(*files: Path) -> subprocess.CompletedProcess[str]:
    command = [TREE / "tools" / "check-words", *files]
    return subprocess.run(command, capture_output=True, text=True)


def test_this_tree_uses_the_words_of_the_project() -> None:
    found = check()
    assert (found.returncode, found.stderr) == (0, "")


def test_lint_checks_words_and_spelling() -> None:
    lint = (TREE / "tools" / "lint").read_text()
    assert "tools/check-words" in lint
    assert "codespell" in lint


@pytest.mark.parametrize(
    ("line", "word", "use"),
    [
        ("The figures of a loop", "figures", "statistics"),
        ("RefusalKind kind;", "Refusal", "error"),
        ("last_refusals = []", "refusals", "error"),
        ("constexpr int MOST_PICTURES = 3;", "PICTURES", "drawing"),
        ("def endTenancy()", "Tenancy", "lease"),
    ],
)
def test_file_line_and_better_word_are_reported(
    tmp_path: Path, line: str, word: str, use: str
) -> None:
    file = tmp_path / "page.md"
    file.write_text(f"A first line\n{line}\n")
    found = check(file)
    assert found.returncode == 1
    assert found.stderr == f"{file}:2: {word}: use '{use}'\n"


@pytest.mark.parametrize("line", ["configures a runner", "troubleshooting", "Figure 1"])
def test_other_words_are_accepted(tmp_path: Path, line: str) -> None:
    file = tmp_path / "page.md"
    file.write_text(line)
    assert check(file).returncode == 0
