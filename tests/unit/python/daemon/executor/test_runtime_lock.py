"""Two rtcfds with one runtime folder: the second one leaves the executors alone."""

import signal
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

import odd_files
import pytest
from daemon_process import DEADLINE_S
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import runner_pb2


@pytest.fixture
def second(tmp_path: Path) -> Iterator[DaemonUnderTest]:
    """Yield a private rtcfd, not started, with its own socket and state."""
    folder = tmp_path / "b"
    folder.mkdir()
    daemon = DaemonUnderTest(folder)
    yield daemon
    if daemon.process is not None and daemon.process.poll() is None:
        daemon.end()


def rejected(daemon: DaemonUnderTest, *options: str, foreground: bool = True) -> str:
    """Start an rtcfd that must end; return its log."""
    daemon.start(*options, foreground=foreground)
    assert daemon.process is not None
    assert daemon.process.wait(DEADLINE_S) == 1
    return daemon.log()


def test_a_private_rtcfd_does_not_take_over_the_loops_of_the_service(
    stopped_daemon: DaemonUnderTest, second: DaemonUnderTest
) -> None:
    service = stopped_daemon.start_service()
    assert service.process is not None
    run = service.folder / "run"
    with service.client() as client:
        client.start()
        before = client.get_status().runners[0]
        stop = (run / "stop").stat()
        files = sorted((run / "executors").iterdir())
        assert rejected(second, "--runtime-dir", str(run)) == (
            f"rtcfd: runtime folder {run} is in use by another rtcfd (pid {service.process.pid}): "
            "end that, or choose another --runtime-dir\n"
        )
        assert not second.socket.exists()
        assert sorted((run / "executors").iterdir()) == files
        found = (run / "stop").stat()
        assert (found.st_ino, stat.S_IMODE(found.st_mode)) == (stop.st_ino, 0o750)
        after = client.get_status().runners[0]
        assert (after.pid, after.state) == (before.pid, runner_pb2.RUNNER_STATE_RUNNING)
        assert after.settings == before.settings
    # Also a client that connects afterwards is served.
    assert service.executor_pid() == before.pid
    assert service.end() == 0


def test_two_private_rtcfds_share_no_runtime_folder(
    daemon: DaemonUnderTest, second: DaemonUnderTest
) -> None:
    executor = daemon.executor_pid()
    run = f"{daemon.socket}.d"
    assert f"runtime folder {run} is in use by another rtcfd" in rejected(
        second, "--runtime-dir", run
    )
    assert daemon.executor_pid() == executor
    # Empty folders stay, too.
    with daemon.client() as client:
        client.remove_runner("rt_runner")
        rejected(second, "--runtime-dir", run)
        client.add_runner("other", runner_pb2.RunnerSettings())
    assert daemon.executor_pid("other")
    assert daemon.end() == 0
    assert not Path(run).exists()
    # The end of one makes way for the other.
    second.start("--runtime-dir", run)
    assert second.executor_pid()


def test_a_killed_rtcfd_leaves_its_executors_to_the_next(stopped_daemon: DaemonUnderTest) -> None:
    service = stopped_daemon.start_service()
    executor = service.executor_pid()
    for number in (signal.SIGKILL, signal.SIGUSR1, signal.SIGKILL):
        service.end(number)
        service.start_service()
        assert service.executor_pid() == executor
    assert service.end() == 0
    assert not (service.folder / "run" / "executors").exists()


def test_the_lock_is_open_to_no_other_user(stopped_daemon: DaemonUnderTest) -> None:
    service = stopped_daemon.start_service()
    found = (service.folder / "run" / "executors" / "lock").stat()
    assert stat.S_IMODE(found.st_mode) == 0o600


@pytest.mark.parametrize("odd", [odd_files.folder, odd_files.dangling, odd_files.plug])
def test_an_obstacle_at_the_locks_path_is_reported_in_one_line(
    second: DaemonUnderTest, odd: Callable[[Path], None]
) -> None:
    run = second.folder / "run"
    (run / "executors").mkdir(parents=True)
    odd(run / "executors" / "lock")
    log = rejected(second, "--runtime-dir", str(run))
    assert log.startswith(f"rtcfd: cannot lock {run}/executors/lock: ")
    assert log.endswith("; remove that file, or choose another --runtime-dir\n")
    assert log.count("\n") == 1


def test_a_runtime_folder_that_cannot_be_made_is_reported_in_one_line(
    second: DaemonUnderTest,
) -> None:
    (second.folder / "file").touch()
    for run, why in (
        (Path("/proc/none"), "No such file or directory"),
        (second.folder / "file", "Not a directory"),
    ):
        second.log_file.unlink(missing_ok=True)
        assert rejected(second, "--runtime-dir", str(run)) == (
            f"rtcfd: cannot make folder {run}/executors: {why}; choose another --runtime-dir\n"
        )
