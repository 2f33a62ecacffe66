"""The folder of CPU claims of a user's private daemons."""

import os
from pathlib import Path

import pytest
from rtcfd.executor.command import claims_folder_of_user


def test_claims_are_in_the_runtime_folder_of_the_user(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert claims_folder_of_user(tmp_path / "own") == tmp_path / "rtcf-cpus"


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to create a folder of another user")
def test_claims_are_not_in_the_runtime_folder_of_another_user(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    os.chown(tmp_path, 65534, 65534)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert claims_folder_of_user(tmp_path / "own").parent != tmp_path
    assert not any(tmp_path.iterdir())
