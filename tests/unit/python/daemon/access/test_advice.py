"""Advice in messages and pages grants no more rights than necessary."""

import re
from pathlib import Path

import pytest
from pages import TREE

FOLDERS = ("client", "components", "daemon", "docs", "shared", "systemd")
# As a user types them; a call in a program has a bracket.
WIDENS = re.compile(r"\b(chmod|chown|chgrp|setcap|usermod|setfacl) +[-+0-9a-zA-Z:/{%]")


def _files() -> list[Path]:
    files = [TREE / "README.md"]
    for folder in FOLDERS:
        files += (file for file in (TREE / folder).rglob("*") if file.is_file())
    return [file for file in files if "__pycache__" not in file.parts]


def test_no_text_advises_to_widen_rights() -> None:
    files = _files()
    assert len(files) > 300
    advice = [
        f"{file.relative_to(TREE)}: {found[0]}"
        for file in files
        for found in WIDENS.finditer(file.read_text(errors="replace"))
    ]
    assert advice == []


@pytest.mark.parametrize(
    "text", ["mend it: sudo chown root /home/alice", "`chmod o-w /tmp`", "setcap cap_sys_nice+ep x"]
)
def test_advice_that_widens_rights_is_found(text: str) -> None:
    assert WIDENS.search(text)


@pytest.mark.parametrize("text", ["::chmod(path, mode)", "os.chown (fd)", "chown: not here"])
def test_other_texts_are_accepted(text: str) -> None:
    assert not WIDENS.search(text)
