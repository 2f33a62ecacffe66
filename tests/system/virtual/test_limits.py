"""Limits of the unit: rights, memory, devices."""

import os
import re
from pathlib import Path

import rtcf
from loop_2khz import FREQUENCY_HZ, Loop
from machine import wait_for
from rtcf.v1 import runner_pb2


def limits(pid: int) -> dict[str, str]:
    lines = Path(f"/proc/{pid}/limits").read_text().splitlines()[1:]
    return {line[:26].strip(): line[26:47].strip() for line in lines}


def status_of(pid: int, field: str) -> str:
    found = re.search(rf"^{field}:\s*(.*)$", Path(f"/proc/{pid}/status").read_text(), re.M)
    assert found is not None
    return found.group(1)


def test_a_loop_has_only_the_rights_for_real_time(loop: Loop) -> None:
    told = loop.told()
    assert list(told.degraded) == []
    assert os.sched_getscheduler(told.realtime_tid) == os.SCHED_FIFO
    assert os.sched_getparam(told.realtime_tid).sched_priority == 82  # derived from its frequency
    assert os.sched_getscheduler(told.pid) == os.SCHED_OTHER
    assert limits(told.pid)["Max locked memory"] == "unlimited"
    assert limits(told.pid)["Max realtime priority"] == "99"
    locked_kb, resident_kb = (int(status_of(told.pid, f).split()[0]) for f in ("VmLck", "VmRSS"))
    assert locked_kb >= resident_kb > 8192
    lock_and_nice = f"{1 << 14 | 1 << 23:016x}"  # CAP_IPC_LOCK, CAP_SYS_NICE
    for field in ("CapPrm", "CapEff", "CapBnd"):
        assert status_of(told.pid, field) == lock_and_nice
    assert status_of(loop.pid, "VmLck") == "0 kB"


def test_only_the_loop_may_keep_the_cpu_awake(loop: Loop) -> None:
    device = "/dev/cpu_dma_latency"
    held = [os.readlink(each) for each in Path(f"/proc/{loop.told().pid}/fd").iterdir()]
    assert device in held
    assert loop.machine.run("stat", "-c", "%U:%G %a", device).stdout.strip() == "root:rtcf 660"
    assert loop.machine.run("cat", device, user="nobody", check=False).returncode != 0


def opens(loop: Loop, device: str) -> bool:
    """Return whether root can open a device in a process of the unit."""
    group = loop.unit_property("ControlGroup")
    script = f"echo $$ >/sys/fs/cgroup{group}/cgroup.procs; exec 3<>{device}"
    return loop.machine.shell(script, check=False).returncode == 0


def test_devices_are_closed_until_a_drop_in_opens_them(loop: Loop) -> None:
    assert opens(loop, "/dev/null")
    assert not opens(loop, "/dev/ttyS0")
    example = loop.machine.path("/usr/share/doc/rtcfd/examples/devices.conf").read_text()
    wanted = [line for line in example.splitlines() if "ttyUSB" in line or "dialout" in line]
    assert len(wanted) == 2
    loop.drop_in("\n".join(wanted).replace("ttyUSB", "ttyS").replace("dialout i2c", "dialout"))
    try:
        loop.systemctl("stop", "rtcfd")
        loop.systemctl("start", "rtcfd")
        assert opens(loop, "/dev/ttyS0")
        assert not opens(loop, "/dev/vda")
        dialout = loop.machine.run("getent", "group", "dialout").stdout.split(":")[2]
        assert dialout in status_of(loop.told().pid, "Groups").split()
    finally:
        loop.drop_in("")


def test_exhausted_memory_ends_one_executor_and_its_graph_is_restored(loop: Loop) -> None:
    daemon, other = loop.pid, loop.now()
    loop.systemctl("set-property", "--runtime", "rtcfd.service", "MemoryMax=400M")
    try:
        with rtcf.Client() as client:
            slow = runner_pb2.RunnerSettings(frequency_hz=100.0)
            hoard = client.add_runner("hoard", slow).pid
            client.load(rtcf.component("rtcf_faults", "Hoards", name="H"), "hoard")
            client.start("hoard")

            def restored() -> bool:
                told = client.get_status("hoard").runners[0]
                return told.pid not in (0, hoard) and told.components == 1

            wait_for(restored, "another executor with its graph")
            assert "was killed by SIGKILL" in client.get_status("hoard").runners[0].status
        group = Path("/sys/fs/cgroup" + loop.unit_property("ControlGroup"))
        events = dict(line.split() for line in (group / "memory.events").read_text().splitlines())
        assert int(events["oom_kill"]) == 1
        assert loop.pid == daemon
        assert loop.unit_property("ActiveState") == "active"
        # Reclaiming memory may cost the other loop one cycle at most.
        now = loop.now()
        assert (now.executor, now.thread) == (other.executor, other.thread)
        assert now.iteration > other.iteration + FREQUENCY_HZ
    finally:
        loop.systemctl("set-property", "--runtime", "rtcfd.service", "MemoryMax=infinity")
        with rtcf.Client() as client:
            client.remove_runner("hoard")
