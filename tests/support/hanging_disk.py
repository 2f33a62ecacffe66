"""A disk that can hang: an ext4 file system in a file, frozen by the kernel."""

import contextlib
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest


class HangingDisk:
    """A disk mounted at `folder`; requires root."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @contextlib.contextmanager
    def hanging(self) -> Iterator[None]:
        """Within the block, a write to the disk waits in the kernel, uninterruptible by signals."""
        _run("fsfreeze", "--freeze", str(self.folder))
        try:
            yield
        finally:
            _run("fsfreeze", "--unfreeze", str(self.folder))


@contextlib.contextmanager
def mounted(folder: Path, image: Path) -> Iterator[HangingDisk]:
    """Mount a disk; skip the test without the permission to mount."""
    folder.mkdir(parents=True)
    with image.open("wb") as file:
        file.truncate(8 * 1024 * 1024)
    try:
        _run("mkfs.ext4", "-q", str(image))
        _run("mount", "-o", "loop", str(image), str(folder))
    except (OSError, subprocess.CalledProcessError) as problem:
        pytest.skip(f"may not mount here: {problem}")
    try:
        folder.chmod(0o700)
        yield HangingDisk(folder)
    finally:
        _run("umount", "--lazy", str(folder))


def _run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True, timeout=60)
