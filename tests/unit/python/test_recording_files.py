"""The beginning of a recording's file, which Ctrl-C may interrupt at any point."""

from pathlib import Path
from unittest import mock

import pytest
from rtcf.recording import files
from rtcf.recording.reader import read_recording


def test_a_file_has_its_name_once_it_can_be_read(tmp_path: Path) -> None:
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


def test_a_file_is_as_before_where_the_one_over_it_has_not_begun(tmp_path: Path) -> None:
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
