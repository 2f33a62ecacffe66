"""The describer of libraries: one process for all callers, and no stale answers."""

import asyncio
import contextlib
import os
from collections.abc import Callable
from pathlib import Path

import odd_files
import pytest
import rtcf
from daemon_process import wait_for
from daemon_under_test import DaemonUnderTest
from rtcfd.catalog import describe
from rtcfd.catalog.describe import Describer


@pytest.fixture
def library(tmp_path: Path) -> Path:
    found = tmp_path / "lib.so"
    found.write_text("first")
    return found


@pytest.fixture
def describer(tmp_path: Path) -> Describer:
    """A describer whose process notes its run, and succeeds if its dependency exists."""
    binary = tmp_path / "executor"
    binary.write_text(
        f"#!/bin/sh\necho >> {tmp_path}/runs\n"
        f'[ -e {tmp_path}/needed ] || {{ echo "libneeded.so: cannot open" >&2; exit 1; }}\n'
    )
    binary.chmod(0o755)
    return Describer(binary)


def runs(folder: Path) -> int:
    """Return the number of description processes so far."""
    return len((folder / "runs").read_text())


def test_simultaneous_callers_share_one_process(
    describer: Describer, library: Path, tmp_path: Path
) -> None:
    (tmp_path / "needed").touch()

    async def work() -> None:
        await asyncio.gather(*(describer.describe(library, "pkg") for _ in range(20)))
        await describer.describe(library, "pkg")

    asyncio.run(work())
    assert runs(tmp_path) == 1


def test_a_failed_library_is_loaded_again_even_if_unchanged(
    describer: Describer, library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(describe, "FAILURE_KEPT_S", 3600.0)

    async def work() -> None:
        for _ in range(3):
            found = await describer.describe(library, "pkg")
            assert "libneeded.so: cannot open" in found.problem
        assert runs(tmp_path) == 1  # repeated calls start no further process
        monkeypatch.setattr(describe, "FAILURE_KEPT_S", 0.0)
        (tmp_path / "needed").touch()  # like the installation of another package
        assert not (await describer.describe(library, "pkg")).problem

    asyncio.run(work())


@pytest.mark.parametrize(
    ("does", "said", "kept"),
    [
        ("kill -SEGV $$", "was killed by SIGSEGV", True),
        ("kill -ABRT $$", "was killed by SIGABRT", True),
        ("exec yes 'a constructor that complains'", "wrote without end", True),
        # As when memory is short.
        ("kill -KILL $$", "was killed by SIGKILL", False),
        ("kill -BUS $$", "was killed by SIGBUS", False),
        ("echo libneeded.so: cannot open >&2; exit 1", "libneeded.so: cannot open", False),
        (r"printf 'Stromst\344rke' >&2; exit 1", "Stromst\ufffdrke", False),
        ("echo nonsense", "wrote no valid description", False),
        ("exec sleep 3600", "did not end within", False),
    ],
)
def test_only_failures_caused_by_the_library_are_cached(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, does: str, said: str, kept: bool
) -> None:
    binary = tmp_path / "executor"
    binary.write_text(f"#!/bin/sh\necho >> {tmp_path}/runs\n{does}\n")
    binary.chmod(0o755)
    monkeypatch.setattr(describe, "FAILURE_KEPT_S", 0.0)
    # Only the sleeping one exceeds the timeout, even on a slow machine.
    monkeypatch.setattr(describe, "TIMEOUT_S", 3.0 if "sleep" in does else 600.0)
    describer = Describer(binary)

    async def work() -> None:
        for _ in range(2):
            assert said in (await describer.describe(library, "pkg")).problem

    asyncio.run(work())
    assert runs(tmp_path) == (1 if kept else 2)


def test_a_cached_failure_ends_with_a_new_file_new_rights_or_a_reload(
    stopped_daemon: DaemonUnderTest,
) -> None:
    daemon = stopped_daemon
    library = daemon.package("odd", crash="SIGSEGV")
    peer = daemon.executor.read_text().partition("\n")[2]
    daemon.executor.write_text(
        f'#!/bin/sh\ncase "$*" in *{library}*) echo >> {daemon.folder}/runs ;; esac\n{peer}'
    )
    daemon.start_service()

    def look(client: rtcf.Client) -> int:
        (problem,) = client.list_types("odd").problems
        assert "was killed by SIGSEGV" in problem
        return runs(daemon.folder)

    with daemon.client() as client:
        assert [look(client), look(client)] == [1, 1]
        daemon.package("odd", crash="SIGSEGV", rebuilt=True)
        assert [look(client), look(client)] == [2, 2]
        # Its owner may have replaced the code, or made it trusted.
        library.chmod(0o600)
        assert [look(client), look(client)] == [3, 3]
        client.reload()
        assert [look(client), look(client)] == [4, 4]
        # A library that loads is not loaded again.
        assert not client.list_types("demo").problems


def test_the_last_of_many_rebuilds_is_cached(
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
def test_a_library_with_endless_output_is_killed(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pipe: str
) -> None:
    binary = tmp_path / "executor"
    binary.write_text(f"#!/bin/sh\nexec yes 'a constructor that complains' >&{pipe}\n")
    binary.chmod(0o755)
    monkeypatch.setattr(describe, "TIMEOUT_S", 600.0)  # not the reason for its end

    async def work() -> str:
        return str((await Describer(binary).describe(library, "pkg")).problem)

    assert asyncio.run(work()) == "the process that loaded it wrote without end"


def test_the_describing_process_is_the_first_to_be_killed_without_memory(
    library: Path, tmp_path: Path
) -> None:
    binary = tmp_path / "executor"
    binary.write_text(
        '#!/bin/sh\nuntil [ "$(cat /proc/$$/oom_score_adj)" = 500 ]; do sleep 0.05; done\n'
        'echo "as is due" >&2\nexit 1\n'
    )
    binary.chmod(0o755)
    assert "as is due" in asyncio.run(Describer(binary).describe(library, "pkg")).problem


def test_child_processes_of_a_library_end_with_its_process(library: Path, tmp_path: Path) -> None:
    binary = tmp_path / "executor"
    child = tmp_path / "child"
    binary.write_text(f"#!/bin/sh\nsleep 1000 >/dev/null 2>&1 &\necho $! > {child}\n")
    binary.chmod(0o755)
    asyncio.run(Describer(binary).describe(library, "pkg"))
    status = Path(f"/proc/{int(child.read_text())}/stat")
    with contextlib.suppress(FileNotFoundError):  # or a zombie
        wait_for(lambda: status.read_text().rpartition(")")[2].split()[0] == "Z", "its end")


@pytest.mark.parametrize(
    ("odd", "said"),
    [
        (odd_files.pipe, "cannot read it: it is a named pipe, not a regular file"),
        (odd_files.folder, "cannot read it: it is a folder, not a regular file"),
        (odd_files.device, "cannot read it: it is a device, not a regular file"),
    ],
)
def test_only_regular_files_are_opened(
    describer: Describer, tmp_path: Path, odd: Callable[[Path], None], said: str
) -> None:
    (tmp_path / "needed").touch()
    odd(tmp_path / "odd.so")
    assert asyncio.run(describer.describe(tmp_path / "odd.so", "pkg")).problem == said
    assert not (tmp_path / "runs").exists()
