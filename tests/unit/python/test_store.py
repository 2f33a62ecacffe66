"""States on disk: what a power cut or a full disk leaves of them."""

import errno
import os
import stat
from pathlib import Path

import pytest
from rtcfd.state.desired import Desired
from rtcfd.state.store import Store


def test_a_stop_outlives_a_power_cut_also_on_a_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path)
    desired = Desired("arm")
    desired.running = True
    store.save("arm", store.text(desired), running=True)
    mark = tmp_path / "arm.running"
    assert mark.exists()
    on_disk: list[bool] = []  # whether the mark is there, by each fsync of the folder

    def full(descriptor: int) -> None:
        if not stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        on_disk.append(mark.exists())

    monkeypatch.setattr(os, "fsync", full)
    desired.running = False
    with pytest.raises(OSError, match="No space left"):
        store.save("arm", store.text(desired), running=False)
    assert on_disk == [False]
    (state,) = store.load()
    assert not state.running
    assert sorted(file.name for file in tmp_path.iterdir()) == ["arm.json"]
