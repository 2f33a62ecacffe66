"""The start of a recording's file, which Ctrl-C may interrupt at any time."""

from pathlib import Path
from unittest import mock

import pytest
from rtcf.recording import files
from rtcf.recording.reader import read_recording


def test_a_file_gets_its_name_once_it_is_readable(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with (
        mock.patch.object(files, "McapWriter", side_effect=KeyboardInterrupt),
        pytest.raises(KeyboardInterrupt),
    ):
        files.Files(path, "runner")
    assert not list(tmp_path.iterdir())
    begun = files.Files(path, "runner")
    read_recording(path).close()
    begun.close()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("-", "a recording is written to a file, name one"),
        ("run.bag", r"run.mcap, then `rtcfctl convert \S*run.mcap \S*run.bag`"),
        ("run.csv", "recordings are MCAP files"),
    ],
)
def test_a_name_of_another_format_is_rejected(tmp_path: Path, name: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        files.Files(tmp_path / name, "runner")
    assert not list(tmp_path.iterdir())


def test_an_existing_file_is_kept_until_its_replacement_is_readable(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    files.Files(path, "runner").close()
    before = path.read_bytes()
    with (
        mock.patch.object(files, "McapWriter", side_effect=KeyboardInterrupt),
        pytest.raises(KeyboardInterrupt),
    ):
        files.Files(path, "runner", force=True)
    assert path.read_bytes() == before
    with pytest.raises(ValueError, match="already exists"):
        files.Files(path, "runner")
    assert [path] == list(tmp_path.iterdir())
