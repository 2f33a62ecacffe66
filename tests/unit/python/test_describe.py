"""The describer of libraries: one process for all who ask, and no answer that stays wrong."""

import asyncio
import contextlib
import os
from collections.abc import Callable
from pathlib import Path

import odd_files
import pytest
import rtcf
from daemon_under_test import DaemonUnderTest, wait_for
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
    """Return how many processes there were that describe."""
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


@pytest.mark.parametrize(
    ("does", "said", "kept"),
    [
        ("kill -SEGV $$", "was killed by SIGSEGV", True),
        ("kill -ABRT $$", "was killed by SIGABRT", True),
        ("exec yes 'a constructor that complains'", "wrote without end", True),
        # As where memory is short.
        ("kill -KILL $$", "was killed by SIGKILL", False),
        ("kill -BUS $$", "was killed by SIGBUS", False),
        ("echo libneeded.so: cannot open >&2; exit 1", "libneeded.so: cannot open", False),
        ("echo nonsense", "wrote no valid description", False),
        ("exec sleep 3600", "did not end within", False),
    ],
)
def test_what_a_library_did_is_kept_and_what_may_have_another_cause_is_not(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, does: str, said: str, kept: bool
) -> None:
    binary = tmp_path / "executor"
    binary.write_text(f"#!/bin/sh\necho >> {tmp_path}/runs\n{does}\n")
    binary.chmod(0o755)
    monkeypatch.setattr(describe, "FAILURE_KEPT_S", 0.0)
    # However slow this machine is, only the one that sleeps takes so long.
    monkeypatch.setattr(describe, "TIMEOUT_S", 3.0 if "sleep" in does else 600.0)
    describer = Describer(binary)

    async def work() -> None:
        for _ in range(2):
            assert said in (await describer.describe(library, "pkg")).problem

    asyncio.run(work())
    assert runs(tmp_path) == (1 if kept else 2)


def test_what_is_kept_of_a_failure_ends_with_its_file_with_its_rights_and_with_a_reload(
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
        # Who may write it may have put other code there, or made it trusted.
        library.chmod(0o600)
        assert [look(client), look(client)] == [3, 3]
        client.reload()
        assert [look(client), look(client)] == [4, 4]
        # A library that loads is not loaded again for it.
        assert not client.list_types("demo").problems


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


def test_where_memory_runs_out_what_describes_goes_first(library: Path, tmp_path: Path) -> None:
    binary = tmp_path / "executor"
    binary.write_text(
        '#!/bin/sh\nuntil [ "$(cat /proc/$$/oom_score_adj)" = 500 ]; do sleep 0.05; done\n'
        'echo "as is due" >&2\nexit 1\n'
    )
    binary.chmod(0o755)
    assert "as is due" in asyncio.run(Describer(binary).describe(library, "pkg")).problem


def test_what_a_library_has_started_ends_with_its_process(library: Path, tmp_path: Path) -> None:
    binary = tmp_path / "executor"
    child = tmp_path / "child"
    binary.write_text(f"#!/bin/sh\nsleep 1000 >/dev/null 2>&1 &\necho $! > {child}\n")
    binary.chmod(0o755)
    asyncio.run(Describer(binary).describe(library, "pkg"))
    status = Path(f"/proc/{int(child.read_text())}/stat")
    with contextlib.suppress(FileNotFoundError):  # or its parent has not yet waited for it
        wait_for(lambda: status.read_text().rpartition(")")[2].split()[0] == "Z", "its end")


@pytest.mark.parametrize(
    ("odd", "said"),
    [
        (odd_files.pipe, "cannot read it: it is a named pipe, not a regular file"),
        (odd_files.folder, "cannot read it: it is a folder, not a regular file"),
        (odd_files.device, "cannot read it: it is a device, not a regular file"),
    ],
)
def test_what_is_no_file_is_not_opened(
    describer: Describer, tmp_path: Path, odd: Callable[[Path], None], said: str
) -> None:
    (tmp_path / "needed").touch()
    odd(tmp_path / "odd.so")
    assert asyncio.run(describer.describe(tmp_path / "odd.so", "pkg")).problem == said
    assert not (tmp_path / "runs").exists()
