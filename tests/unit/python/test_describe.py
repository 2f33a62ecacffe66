"""The describer of libraries: one process for all who ask, and no answer that stays wrong."""

import asyncio
import os
from collections.abc import Callable
from pathlib import Path

import odd_files
import pytest
from rtcfd.catalog import describe
from rtcfd.catalog.describe import Describer


@pytest.fixture
def library(tmp_path: Path) -> Path:
    found = tmp_path / "lib.so"
    found.write_text("first")
    return found


@pytest.fixture
def describer(tmp_path: Path) -> Describer:
    """One whose process notes that it ran, and succeeds where what it needs is there."""
    binary = tmp_path / "executor"
    binary.write_text(
        f"#!/bin/sh\necho >> {tmp_path}/runs\n"
        f'[ -e {tmp_path}/needed ] || {{ echo "libneeded.so: cannot open" >&2; exit 1; }}\n'
    )
    binary.chmod(0o755)
    return Describer(binary)


def runs(folder: Path) -> int:
    return len((folder / "runs").read_text())


def test_who_asks_at_once_waits_for_one_process(
    describer: Describer, library: Path, tmp_path: Path
) -> None:
    (tmp_path / "needed").touch()

    async def work() -> None:
        await asyncio.gather(*(describer.describe(library, "pkg") for _ in range(20)))
        await describer.describe(library, "pkg")

    asyncio.run(work())
    assert runs(tmp_path) == 1


def test_what_did_not_load_is_looked_at_again_though_its_file_is_the_same(
    describer: Describer, library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(describe, "FAILURE_KEPT_S", 3600.0)

    async def work() -> None:
        for _ in range(3):
            found = await describer.describe(library, "pkg")
            assert "libneeded.so: cannot open" in found.problem
        assert runs(tmp_path) == 1  # who asks all the time starts no process each time
        monkeypatch.setattr(describe, "FAILURE_KEPT_S", 0.0)
        (tmp_path / "needed").touch()  # as another package is installed
        assert not (await describer.describe(library, "pkg")).problem

    asyncio.run(work())


def test_of_a_file_that_is_rebuilt_again_and_again_the_last_is_kept(
    describer: Describer, library: Path, tmp_path: Path
) -> None:
    (tmp_path / "needed").touch()

    async def work() -> None:
        for number in range(5):
            library.write_text("x" * number)
            os.utime(library, (number, number))
            await describer.describe(library, "pkg")
        assert runs(tmp_path) == 5
        assert len(describer.kept) == 1

    asyncio.run(work())


@pytest.mark.parametrize("pipe", ["1", "2"], ids=["output", "errors"])
def test_a_library_that_writes_without_end_is_ended(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pipe: str
) -> None:
    binary = tmp_path / "executor"
    binary.write_text(f"#!/bin/sh\nexec yes 'a constructor that complains' >&{pipe}\n")
    binary.chmod(0o755)
    monkeypatch.setattr(describe, "TIMEOUT_S", 600.0)  # not why it ends

    async def work() -> str:
        return str((await Describer(binary).describe(library, "pkg")).problem)

    assert asyncio.run(work()) == "the process that loaded it wrote without end"


@pytest.mark.parametrize(
    ("odd", "said"),
    [
        (odd_files.pipe, "cannot read it: it is a named pipe, no regular file"),
        (odd_files.folder, "cannot read it: it is a folder, no regular file"),
        (odd_files.device, "cannot read it: it is a device, no regular file"),
    ],
)
def test_what_is_no_file_is_not_opened(
    describer: Describer, tmp_path: Path, odd: Callable[[Path], None], said: str
) -> None:
    (tmp_path / "needed").touch()
    odd(tmp_path / "odd.so")
    assert asyncio.run(describer.describe(tmp_path / "odd.so", "pkg")).problem == said
    assert not (tmp_path / "runs").exists()
