"""How rtcfd and its executors end: in order, with nothing left, for any cause."""

import os
import signal
import socket
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import rtcf
from daemon_process import DEADLINE_S, Daemon, is_gone, stopped, wait_for
from values import iteration

HOOKS = ["configure", "start", "update", "safe", "stop", "cleanup"]


def _hooks(daemon: Daemon) -> list[str]:
    """Return the hooks of the Witness, in the order of its log records."""
    return [line.partition(": hook ")[2].split()[0] for line in daemon.log().splitlines()
            if ": hook " in line]  # fmt: skip


def _executor(client: rtcf.Client) -> int:
    return int(client.get_status("rt_runner").runners[0].pid)


def _accepts(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True


@pytest.mark.parametrize(
    "end",
    [
        lambda daemon: daemon.end(signal.SIGTERM),
        lambda daemon: daemon.end(signal.SIGINT),
        Daemon.press_ctrl_c,
    ],
    ids=["SIGTERM", "SIGINT", "Ctrl-C"],
)
def test_a_signal_ends_loop_and_executor_in_order(
    daemon: Daemon, client: rtcf.Client, end: Callable[[Daemon], int]
) -> None:
    client.load(rtcf.component("rtcf_test", "Witness"))
    client.start()
    wait_for(lambda: iteration(client) > 100, "100 cycles")
    executor = _executor(client)

    assert end(daemon) == 0

    assert is_gone(executor)
    assert _hooks(daemon) == HOOKS
    assert f"executor (pid {executor}) ended with exit status 0" in daemon.log()
    assert not daemon.socket.exists()
    assert not daemon.socket.with_name(daemon.socket.name + ".d").exists()


def test_a_killed_executor_leaves_no_folder(tmp_path: Path) -> None:
    daemon = Daemon(tmp_path)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        executor = _executor(client)
    # It can neither end in order nor be replaced: rtcfd is ending.
    os.kill(executor, signal.SIGSTOP)
    os.kill(daemon.pid, signal.SIGTERM)
    wait_for(lambda: "stopping all loops" in daemon.log(), "the end to begin")
    os.kill(executor, signal.SIGKILL)
    assert daemon.end() == 0
    assert not daemon.socket.with_name(daemon.socket.name + ".d").exists()


def test_a_successor_waits_for_the_end_of_its_predecessor(tmp_path: Path) -> None:
    daemon = Daemon(tmp_path)
    (tmp_path / "b").mkdir()
    run = daemon.socket.with_name(daemon.socket.name + ".d")
    successor = Daemon(tmp_path / "b", arguments=("--runtime-dir", str(run)))
    successor.log_file.touch()
    file = tmp_path / "file"
    slow = rtcf.component("rtcf_test", "ConfiguresOnceThereIs", parameters=[f"file:={file}"])
    daemon.start()
    waits = f"waiting for the end of the rtcfd (pid {daemon.pid}) that uses {run}"
    with rtcf.Client(daemon.socket) as client, ThreadPoolExecutor() as pool:
        executor = _executor(client)
        progress = threading.Event()
        loading = pool.submit(client.load, slow, on_progress=lambda _: progress.set())
        assert progress.wait(DEADLINE_S)
        os.kill(daemon.pid, signal.SIGTERM)
        wait_for(lambda: not _accepts(run / "executors" / "control"), "the end to begin")
        with stopped(daemon.pid):  # it cannot end now
            starting = pool.submit(successor.start)
            wait_for(lambda: waits in successor.log(), "its line")
        file.touch()
        assert daemon.end() == 0
        loading.exception()
        starting.result()
    try:
        with rtcf.Client(successor.socket) as client:
            assert _executor(client) != executor
    finally:
        assert successor.end() == 0
    assert is_gone(executor)
    assert list(run.iterdir()) == []


def test_stop_ends_the_loop_in_order_and_keeps_the_executor(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Witness"))
    client.start()
    wait_for(lambda: iteration(client) > 100, "100 cycles")
    executor = _executor(client)
    assert daemon.ctl("stop").returncode == 0
    cycles = iteration(client)
    wait_for(lambda: "hook stop" in daemon.log(), "the stop hook")
    assert _hooks(daemon) == HOOKS[:-1]
    assert (iteration(client), _executor(client)) == (cycles, executor)
    # Neither command fails if there is nothing to do.
    assert daemon.ctl("stop").returncode == 0
    assert daemon.ctl("start").returncode == 0
    assert daemon.ctl("start").returncode == 0


def test_a_signal_to_the_executor_ends_it_in_order(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Witness"))
    client.start()
    wait_for(lambda: iteration(client) > 100, "100 cycles")
    executor = _executor(client)
    os.kill(executor, signal.SIGTERM)
    wait_for(lambda: "its loop is down" in daemon.log(), "rtcfd's message")
    assert is_gone(executor)
    assert _hooks(daemon) == HOOKS


def test_a_signal_during_start_hooks_prevents_the_first_cycle(
    daemon: Daemon, client: rtcf.Client
) -> None:
    gate = daemon.folder / "gate"
    client.load(rtcf.component("rtcf_test", "Witness"))
    client.load(
        rtcf.component(
            "rtcf_test", "StartsOnceThereIs", name="last", parameters=[f"file:='{gate}'"]
        )
    )
    assert client.get_order() == ["/Witness", "/last"]
    stop_socket = Path(f"{daemon.socket}.d/stop/rt_runner")
    assert stop_socket.exists()
    executor = _executor(client)
    with ThreadPoolExecutor() as beside:
        starting = beside.submit(client.start)
        try:
            wait_for(lambda: "waits for a file" in daemon.log(), "the start hook")
            os.kill(executor, signal.SIGTERM)
            # From this moment on no client can ask it to stop.
            wait_for(lambda: not stop_socket.exists(), "the executor to take the signal")
        finally:
            gate.touch()
        with pytest.raises(rtcf.RefusedError):
            starting.result()
    wait_for(lambda: is_gone(executor), "its end")
    wait_for(lambda: "hook cleanup" in daemon.log(), "its last records")
    assert _hooks(daemon) == [hook for hook in HOOKS if hook not in ("update", "safe")]


def test_exit_codes(daemon: Daemon) -> None:
    codes = {
        "status": 0,
        "start": 0,
        "unload nobody": 1,
        "-r nobody status": 1,
        "unload": 2,
        "no-such-verb": 2,
        "load rtcf_examples Mimo --remap a": 2,
        "--socket /nowhere/at/all status": 3,
    }
    for command, code in codes.items():
        done = daemon.ctl(*command.split())
        assert done.returncode == code, command
        assert code == 0 or done.stderr
    daemon.end()
    done = daemon.ctl("status")
    assert (done.returncode, done.stdout) == (3, "")
    assert str(daemon.socket) in done.stderr
    assert done.stderr.count("\n") == 1
