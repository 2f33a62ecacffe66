"""Stops of loops at their executors: rtcfd is frozen, dead or busy, or the disk is full."""

import contextlib
import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import rtcf
from daemon_process import BUILD_TREE, NO_ROS, Daemon, stopped, wait_for
from hanging_disk import HangingDisk, mounted
from rtcf.v1 import runner_pb2
from values import iteration

RESUME = "[runner]\non_boot = 'resume'\norphan_timeout_s = 60.0\n" + NO_ROS
STRANGER = 54321  # an unused uid
ASK = (
    "import socket, sys\n"
    "peer = socket.socket(socket.AF_UNIX)\n"
    "peer.settimeout(30)\n"
    "peer.connect(sys.argv[1])\n"
    "try:\n"
    "    peer.sendall(b'stop\\n')\n"
    "except OSError:\n"
    "    pass\n"
    "print(peer.recv(4096).decode(), end='')\n"
)


@pytest.fixture
def settings() -> str:
    return RESUME


def runs(client: rtcf.Client) -> bool:
    """Return whether the loop runs."""
    state: int = client.get_status("rt_runner").runners[0].state
    return state == runner_pb2.RUNNER_STATE_RUNNING


def begin(client: rtcf.Client) -> None:
    """Start a loop and wait for cycles."""
    if not client.get_order():
        client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
    client.start()
    wait_for(lambda: iteration(client) > 10, "cycles")


def stop_by_command(daemon: Daemon, *options: str, out: str = "stopped") -> str:
    """Stop with rtcfctl, which must report success; return its standard error."""
    done = daemon.ctl("stop", *options)
    assert (done.returncode, done.stdout) == (0, f"{out}\n"), done.stderr
    return done.stderr


def mark(daemon: Daemon) -> Path:
    """Return the file that marks the loop for resuming."""
    return daemon.folder / "state" / "rt_runner.running"


def test_a_frozen_daemon_blocks_no_stop_and_learns_of_it_later(
    daemon: Daemon, client: rtcf.Client
) -> None:
    begin(client)
    assert mark(daemon).exists()
    with stopped(daemon.pid):
        said = stop_by_command(daemon)
        assert "at its executor, because rtcfd does not answer within 0.5 s" in said
        # The stop is on disk, even if rtcfd ends now.
        assert not mark(daemon).exists()
    assert not runs(client)
    wait_for(lambda: "loop stopped at its executor by " in daemon.log(), "the log")
    wait_for(
        lambda: '"running": false' in (daemon.folder / "state" / "rt_runner.json").read_text(),
        "the state on disk",
    )
    begin(client)


def test_a_start_requested_before_the_stop_starts_nothing(
    daemon: Daemon, client: rtcf.Client
) -> None:
    begin(client)
    with (
        stopped(daemon.pid),
        subprocess.Popen(
            [BUILD_TREE / "bin" / "rtcfctl", "start"],
            env=daemon.environment(),
            stderr=subprocess.PIPE,
            text=True,
        ) as early,
    ):
        # It is connected, and waits for the answer.
        wait_for(lambda: _connections(daemon) > 1, "the early start")
        assert daemon.ctl("stop").returncode == 0
        os.kill(daemon.pid, signal.SIGCONT)
        error = early.communicate(timeout=60)[1]
    assert (early.returncode, "repeat the request" in error) == (1, True), error
    assert not runs(client)


def _connections(daemon: Daemon) -> int:
    lines = Path("/proc/net/unix").read_text().splitlines()
    return sum(line.endswith(str(daemon.socket)) for line in lines) - 1


def test_a_dead_daemon_blocks_no_stop_and_its_successor_resumes_nothing(
    daemon: Daemon, client: rtcf.Client
) -> None:
    begin(client)
    executor = client.get_status("rt_runner").runners[0].pid
    daemon.end(signal.SIGKILL)
    stop_by_command(daemon, "--all", out="rt_runner stopped")
    # Also without the executor, which remembers the stop.
    os.kill(executor, signal.SIGKILL)
    daemon.start()
    with rtcf.Client(daemon.socket) as again:
        wait_for(lambda: again.get_status("rt_runner").runners[0].pid, "an executor")
        assert not runs(again)
        assert again.get_order() == ["/steady"]


def test_the_next_daemon_learns_that_the_loop_was_stopped(
    daemon: Daemon, client: rtcf.Client
) -> None:
    begin(client)
    executor = client.get_status("rt_runner").runners[0].pid
    daemon.end(signal.SIGKILL)
    assert daemon.ctl("stop").returncode == 0
    daemon.start()
    with rtcf.Client(daemon.socket) as again:
        assert again.get_status("rt_runner").runners[0].pid == executor
        assert not runs(again)
        begin(again)
    assert "by root" in daemon.log() or os.geteuid()


def test_clients_in_all_slots_block_no_stop(tmp_path: Path) -> None:
    daemon = Daemon(tmp_path, "[limits]\nclients = 4\n" + NO_ROS)
    daemon.start()
    others: list[socket.socket] = []
    try:
        with rtcf.Client(daemon.socket) as client:
            begin(client)
        for _ in range(600):
            other = socket.socket(socket.AF_UNIX)
            other.setblocking(False)
            try:
                other.connect(str(daemon.socket))
            except BlockingIOError:
                other.close()
                break
            others.append(other)
        stop_by_command(daemon)
    finally:
        for other in others:
            other.close()
    with rtcf.Client(daemon.socket) as client:
        wait_for(lambda: _answers(client), "an answer")
        assert not runs(client)
    daemon.end()


def _answers(client: rtcf.Client) -> bool:
    try:
        client.get_status()
    except rtcf.RtcfError:
        return False
    return True


def test_a_full_disk_blocks_no_stop_and_the_loop_stays_stopped(tmp_path: Path) -> None:
    # No file can grow, as on a full disk.
    folder = tmp_path / "d"
    folder.mkdir()
    daemon = Daemon(folder, RESUME)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        begin(client)
        resource.prlimit(daemon.pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
        result = client.stop()
        assert any("not saved" in note for note in result.notes), result
        assert not runs(client)
    assert '"running": true' in (folder / "state" / "rt_runner.json").read_text()
    daemon.end(signal.SIGKILL)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        assert not runs(client)
    daemon.end()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Yield a folder whose `state` is a separate, small disk."""
    folder = tmp_path / "d"
    disk = folder / "state"
    disk.mkdir(parents=True)
    mounting = ["mount", "-t", "tmpfs", "-o", "size=256k,mode=0700", "rtcf-test", str(disk)]
    mounted = subprocess.run(mounting, capture_output=True, text=True, check=False)
    if mounted.returncode:
        pytest.skip(f"may not mount here: {mounted.stderr.strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(disk)], check=True)


def fill(disk: Path) -> None:
    """Fill the disk completely."""
    with (disk / "filler").open("wb", buffering=0) as filler:
        for size in (4096, 1):
            with contextlib.suppress(OSError):
                while True:
                    filler.write(b"x" * size)
    found = os.statvfs(disk)
    assert (found.f_bfree, found.f_bavail) == (0, 0)


def test_a_disk_without_a_free_byte_blocks_no_stop(small_disk: Path) -> None:
    disk = small_disk / "state"
    daemon = Daemon(small_disk, RESUME)
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            begin(client)
            fill(disk)
            result = client.stop()
            assert any("not saved" in note for note in result.notes), result
            assert not runs(client)
            assert not mark(daemon).exists()
            # Nor where only the executor can stop the loop.
            begin(client)
            with stopped(daemon.pid):
                stop_by_command(daemon)
                assert not mark(daemon).exists()
            wait_for(lambda: not runs(client), "rtcfd to notice it")
        # The disk still says that it runs, as it was too full to record the stop.
        assert '"running": true' in (disk / "rt_runner.json").read_text()
        daemon.end(signal.SIGKILL)
        daemon.start()
        with rtcf.Client(daemon.socket) as client:
            assert not runs(client)
    finally:
        daemon.end()


NOT_YET = "not saved yet: the disk of the state folder does not answer"


@pytest.fixture
def hanging_disk(tmp_path: Path) -> Iterator[HangingDisk]:
    """Yield a disk that can hang; `state` of the folder `d` is on it."""
    with mounted(tmp_path / "d" / "state", tmp_path / "image") as disk:
        yield disk


@pytest.fixture
def daemon_on_it(hanging_disk: HangingDisk) -> Iterator[Daemon]:
    """Yield an rtcfd whose state is on that disk."""
    daemon = Daemon(hanging_disk.folder.parent, RESUME)
    daemon.start()
    yield daemon
    if not daemon.ended:
        daemon.end()


def test_a_hanging_disk_blocks_no_stop_and_is_updated_later(
    daemon_on_it: Daemon, hanging_disk: HangingDisk
) -> None:
    daemon = daemon_on_it
    with rtcf.Client(daemon.socket) as client:
        begin(client)
        with hanging_disk.hanging():
            assert NOT_YET in client.stop().notes
            assert not runs(client)
            # Nor does it block a start, or the stop after it.
            assert NOT_YET in client.start().notes
            assert runs(client)
            assert NOT_YET in stop_by_command(daemon)
            assert not runs(client)
            assert client.get_status("rt_runner").runners[0].status == NOT_YET
        wait_for(lambda: not client.get_status("rt_runner").runners[0].status, "the disk")
        assert not mark(daemon).exists()
    daemon.end(signal.SIGKILL)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        assert not runs(client)


def test_an_executor_stops_repeatedly_with_a_hanging_disk(
    daemon_on_it: Daemon, hanging_disk: HangingDisk
) -> None:
    daemon = daemon_on_it
    with rtcf.Client(daemon.socket) as client:
        begin(client)
        with hanging_disk.hanging():
            for _ in range(2):
                with stopped(daemon.pid):
                    for _ in range(2):
                        assert NOT_YET in stop_by_command(daemon)
                wait_for(lambda: not runs(client), "rtcfd to notice it")
                begin(client)
            assert f"rt_runner: {NOT_YET}" in stop_by_command(
                daemon, "--all", out="rt_runner stopped"
            )
            assert not runs(client)
        wait_for(lambda: not mark(daemon).exists(), "the disk")


def test_the_end_of_rtcfd_ends_loops_with_a_hanging_disk(
    daemon_on_it: Daemon, hanging_disk: HangingDisk
) -> None:
    daemon = daemon_on_it
    with rtcf.Client(daemon.socket) as client:
        begin(client)
        executor = client.get_status("rt_runner").runners[0].pid
    with hanging_disk.hanging():
        os.kill(daemon.pid, signal.SIGTERM)
        wait_for(lambda: not Path(f"/proc/{executor}").exists(), "the end of the executor")
    wait_for(lambda: daemon.ended, "the end of rtcfd")
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        assert not runs(client)


def test_an_incident_in_work_does_not_keep_rtcfd_with_a_hanging_disk(
    daemon_on_it: Daemon, hanging_disk: HangingDisk
) -> None:
    daemon = daemon_on_it
    with rtcf.Client(daemon.socket) as client:
        begin(client)
        client.take_incident()

    def states() -> dict[str, str]:
        """Return the state of each thread of rtcfd: D waits for a disk, Z has ended."""
        stats = Path(f"/proc/{daemon.pid}/task").glob("*/stat")
        return {each.parent.name: each.read_text().rpartition(")")[2].split()[0] for each in stats}

    def take() -> None:
        with contextlib.suppress(rtcf.RtcfError), rtcf.Client(daemon.socket) as client:
            client.take_incident()

    with hanging_disk.hanging():
        taking = threading.Thread(target=take)
        taking.start()
        wait_for(lambda: "D" in states().values(), "a thread that waits for the disk")
        os.kill(daemon.pid, signal.SIGTERM)
        # Only the kernel keeps the process, because of that thread.
        wait_for(lambda: states()[str(daemon.pid)] == "Z", "the end of its main thread")
        assert "an incident is not written after" in daemon.log()
        taking.join()
    wait_for(lambda: daemon.ended, "the end of rtcfd")
    daemon.start()


def test_a_stopping_executor_reports_a_read_only_disk(
    daemon_on_it: Daemon, hanging_disk: HangingDisk
) -> None:
    daemon = daemon_on_it
    with rtcf.Client(daemon.socket) as client:
        begin(client)
        remount = ["mount", "-o", "remount,ro", str(hanging_disk.folder)]
        subprocess.run(remount, check=True, capture_output=True)
        with stopped(daemon.pid):
            assert "not saved: Read-only file system" in stop_by_command(daemon)
        wait_for(lambda: not runs(client), "rtcfd to notice it")


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """Yield a folder that other users can enter, unlike pytest's."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to act as another user")
def test_a_user_without_operate_cannot_stop_at_the_executor(open_folder: Path) -> None:
    daemon = Daemon(open_folder, f"[access]\ndefault = 'observe'\n{NO_ROS}")
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            begin(client)
            path = Path(f"{daemon.socket}.d/stop/rt_runner")
            for folder in (path.parent, path.parent.parent):
                folder.chmod(0o755)
            path.chmod(0o666)
            done = subprocess.run(
                ["setpriv", f"--reuid={STRANGER}", "--clear-groups", "--",
                 "/usr/bin/python3", "-c", ASK, str(path)],
                capture_output=True, text=True, timeout=60, check=False,
            )  # fmt: skip
            assert done.stdout == (
                f"refused: stop requires the right `operate`, but user {STRANGER} has none\n"
            ), done.stderr
            assert runs(client)
            # Invalid or incomplete requests do nothing and block nobody.
            for nonsense in (b"start\n", b"stop", b"\0" * 4096):
                with socket.socket(socket.AF_UNIX) as peer:
                    peer.connect(str(path))
                    peer.sendall(nonsense)
            assert runs(client)
            asked = subprocess.run(
                [sys.executable, "-c", ASK, str(path)], capture_output=True, text=True, check=True
            )
            assert asked.stdout == "stopped\n"
            wait_for(lambda: not runs(client), "the end of the loop")
    finally:
        daemon.end()


def test_one_command_stops_all_loops(daemon: Daemon, client: rtcf.Client) -> None:
    client.add_runner("second")
    for runner in ("rt_runner", "second"):
        client.load(rtcf.component("rtcf_test", "Counter"), runner)
        client.start(runner)
    done = daemon.ctl("stop", "--all")
    assert (done.returncode, done.stdout) == (0, "rt_runner stopped\nsecond stopped\n")
    states = {each.runner: each.state for each in client.get_status().runners}
    assert set(states.values()) == {runner_pb2.RUNNER_STATE_STOPPED}
