"""Files that are written completely or not at all."""

import errno
import os
import threading
from pathlib import Path

import pytest
from rtcf_shared.whole_files import whole_file


def test_the_file_appears_once_it_is_complete(tmp_path: Path) -> None:
    to = tmp_path / "file"
    with whole_file(to) as part:
        part.write_text("half ")
        assert not to.exists()
        part.write_text("all")
    assert to.read_text() == "all"
    assert os.listdir(tmp_path) == ["file"]


@pytest.mark.parametrize("force", [False, True])
def test_a_failed_write_keeps_the_old_file(tmp_path: Path, force: bool) -> None:
    to = tmp_path / "file"
    before = []
    if force:
        to.write_text("old")
        before = ["file"]
    with pytest.raises(ZeroDivisionError), whole_file(to, force=force) as part:
        part.write_text("half")
        raise ZeroDivisionError
    assert os.listdir(tmp_path) == before
    assert not force or to.read_text() == "old"


def test_an_existing_file_is_kept(tmp_path: Path) -> None:
    to = tmp_path / "file"
    to.write_text("old")
    with pytest.raises(FileExistsError), whole_file(to):
        pytest.fail("nothing is written")
    to.unlink()
    with pytest.raises(FileExistsError), whole_file(to) as part:
        part.write_text("mine")
        to.write_text("of another, meanwhile")
    assert to.read_text() == "of another, meanwhile"
    assert os.listdir(tmp_path) == ["file"]


def test_force_overwrites_it(tmp_path: Path) -> None:
    to = tmp_path / "file"
    to.write_text("old")
    with whole_file(to, force=True) as part:
        part.write_text("new")
    assert to.read_text() == "new"


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "file")
    (tmp_path / "file").write_text("old")
    with whole_file(link, force=True) as part:
        part.write_text("new")
    assert link.is_symlink()
    assert (tmp_path / "file").read_text() == "new"


def test_a_file_system_without_hard_links_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def link(*_: object) -> None:
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "link", link)
    with whole_file(tmp_path / "file") as part:
        part.write_text("all")
    assert (tmp_path / "file").read_text() == "all"


def test_a_pipe_is_written_directly(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[str] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    with whole_file(pipe) as to:
        to.write_text("through")
    reader.join()
    assert read == ["through"]
    assert os.listdir(tmp_path) == ["pipe"]
