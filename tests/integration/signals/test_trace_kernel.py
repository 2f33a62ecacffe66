"""`rtcfctl trace --kernel`: the kernel's trace of a real loop that is delayed."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import rtcf
from daemon_process import BUILD_TREE, Daemon, clean_environment, wait_for
from realtime_thread import RealtimeThread

MOUNT = "mountpoint -q /sys/kernel/tracing || mount -t tracefs tracefs /sys/kernel/tracing"
MOUNTED = ("unshare", "--mount", "sh", "-c", f'{{ {MOUNT}; }} && exec "$0" "$@"')
# Uses the CPU for 5 cycles, 20 times; ends by itself.
HOG = """
import time
open("/proc/self/comm", "w").write("the hog")
for _ in range(20):
    time.sleep(0.02)
    until = time.monotonic() + 0.005
    while time.monotonic() < until:
        pass
"""


def trace(daemon: Daemon, *words: str | Path) -> list[str]:
    """Return the command of a trace."""
    program = str(BUILD_TREE / "bin" / "rtcfctl")
    return [program, "--socket", str(daemon.socket), "trace", *map(str, words)]


# The inode number of the first PID namespace (linux/proc_ns.h).
IN_CONTAINER = os.stat("/proc/self/ns/pid").st_ino != 0xEFFFFFFC


@pytest.fixture
def tracefs() -> tuple[str, ...]:
    """Return a command prefix that mounts tracefs."""
    done = subprocess.run([*MOUNTED, "true"], capture_output=True, text=True)
    if done.returncode != 0:
        pytest.skip(f"tracefs cannot be mounted here: {done.stderr.strip()}")
    return MOUNTED


@pytest.fixture
def mounted(tracefs: tuple[str, ...]) -> tuple[str, ...]:
    """Return the same, where processes have the kernel's process ids."""
    if IN_CONTAINER:
        pytest.skip("this is a container")
    return tracefs


def test_a_thread_of_higher_priority_is_named(
    running: Daemon, client: rtcf.Client, tmp_path: Path, mounted: tuple[str, ...]
) -> None:
    RealtimeThread(client)
    (status,) = client.get_status("rt_runner").runners
    if not status.HasField("loop_cpu"):
        pytest.skip("the loop does not run in real time here: " + "; ".join(status.degraded))
    file = tmp_path / "trace.json"
    tracing = subprocess.Popen(
        [*mounted, *trace(running, "-o", file, "--kernel", "--output", "json")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=clean_environment(),
    )  # fmt: skip

    def begun() -> bool:
        assert tracing.poll() is None, tracing.communicate()
        parts = list(tmp_path.glob(f".{file.name}.*.part"))
        return bool(parts) and '"ph": "X"' in parts[0].read_text()

    # In a virtual machine the timer of an idle CPU fires late and would be the cause.
    busy = subprocess.Popen(
        ["timeout", "120", "taskset", "--cpu-list", str(status.loop_cpu), "chrt", "--idle", "0",
         sys.executable, "-c", "while True: pass"],
    )  # fmt: skip
    try:
        wait_for(begun, "the first cycles")
        hog = subprocess.Popen(
            ["timeout", "60", "taskset", "--cpu-list", str(status.loop_cpu), "chrt", "--fifo", "90",
             sys.executable, "-c", HOG],
        )  # fmt: skip
        assert hog.wait(60) == 0
        tracing.send_signal(signal.SIGINT)
        said, error = tracing.communicate(timeout=60)
    finally:
        tracing.kill()
        tracing.wait()
        busy.terminate()
        busy.wait()
    assert tracing.returncode == 0, error
    told = json.loads(said)
    assert len(told["kernel"]) == told["late"] > 0
    hogs = [each for each in told["kernel"] if "thread the hog (pid " in each["instead"]]
    assert len(hogs) >= 10, told["kernel"]
    for each in hogs:
        assert each["kind"] == "thread"
        assert each["instead"].endswith(", real-time priority 90)")
        assert each["us"] > 500
    marks = [each for each in json.loads(file.read_text()) if "the hog" in each["name"]]
    assert [each["args"]["cycle"] for each in marks] == [each["cycle"] for each in hogs]
    assert not list(Path("/sys/kernel/tracing").glob("instances/rtcf-*"))


def test_nothing_is_left_in_the_kernel(
    running: Daemon, tmp_path: Path, mounted: tuple[str, ...]
) -> None:
    """The next trace removes what a killed one leaves."""
    left = "/sys/kernel/tracing/instances/rtcf-999999999"
    listed = 'mkdir "$0" && "$@" && ls /sys/kernel/tracing/instances'
    command = trace(running, "-o", tmp_path / "t.json", "--kernel", "--cycles", "100")
    done = subprocess.run(
        [*mounted, "sh", "-c", listed, left, *command],
        capture_output=True, text=True, env=clean_environment(),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "rtcf-" not in done.stdout.partition("t.json: ")[2].partition("\n")[2]


def test_a_container_is_rejected_in_one_line(
    running: Daemon, tmp_path: Path, tracefs: tuple[str, ...]
) -> None:
    command = trace(running, "-o", tmp_path / "t.json", "--kernel", "--cycles", "100")
    done = subprocess.run(
        [*tracefs, "unshare", "--pid", "--fork", "--mount-proc", *command],
        capture_output=True, text=True, env=clean_environment(),
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        "rtcfctl: trace --kernel: process IDs in this container differ from the kernel's: run it "
        "on the host"
    ]


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to drop capabilities")
def test_errors_are_one_line(running: Daemon, client: rtcf.Client, tmp_path: Path) -> None:
    command = trace(running, "-o", tmp_path / "t.json", "--kernel")
    unmounted = ("unshare", "--mount", "sh", "-c",
                 'umount -a -t tracefs 2>/dev/null; exec "$0" "$@"')  # fmt: skip
    done = subprocess.run(
        [*unmounted, *command], capture_output=True, text=True, env=clean_environment()
    )
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        "rtcfctl: trace --kernel: no tracefs is mounted: "
        "sudo mount -t tracefs tracefs /sys/kernel/tracing"
    ]
    client.stop()
    done = subprocess.run(command, capture_output=True, text=True, env=clean_environment())
    assert done.returncode == 2
    assert done.stderr == (
        "rtcfctl: --kernel: the loop of rt_runner does not run; start it first\n"
    )
    assert not list(tmp_path.glob("*t.json*"))
