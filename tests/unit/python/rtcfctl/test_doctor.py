"""`rtcfctl doctor`: each finding depends on files created for the test; and on the real machine."""

import json
import os
import resource
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.diagnosis import Finding, Grade, Host, Loop, cpu_of_next_loop, cpus, diagnose
from rtcf.v1 import runner_pb2
from rtcfctl.machine import doctor
from rtcfctl.terminal.output import Output
from strangers import open_to_strangers, root_only, stranger

PID = 42
CPU = "/sys/devices/system/cpu"

# A machine without findings, and changes that cause one finding each: topic, file, its content,
# the resulting grade, and a part of the advice.
FIT = {
    "/sys/kernel/realtime": "1",
    "/proc/version": "Linux version 6.1.0 SMP PREEMPT_RT",
    "/proc/sys/kernel/sched_rt_runtime_us": "-1",
    "/proc/sys/kernel/sched_rt_period_us": "1000000",
    "/proc/sys/kernel/osrelease": "6.1.0",
    "/boot/config-6.1.0": "CONFIG_PREEMPT_RT=y",
    f"/proc/{PID}/status": "CapEff:\t0000000000804000\nVmLck:\t  45000 kB\nCpus_allowed_list:\t0-3",
    f"/proc/{PID}/limits": "Max realtime priority     0      0\nMax locked memory   8   8  bytes",
    f"{CPU}/isolated": "3",
    f"{CPU}/nohz_full": "2-3",
    f"{CPU}/online": "0-3",
    f"{CPU}/cpu3/cpufreq/scaling_governor": "performance",
    f"{CPU}/cpu3/cpuidle/state0/name": "POLL",
    f"{CPU}/cpu3/cpuidle/state0/latency": "0",
    f"{CPU}/cpu3/topology/thread_siblings_list": "3",
    "/sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc",
    "/proc/irq/9/smp_affinity_list": "0-2",
    "/proc/irq/9/acpi/x": "",
    "/proc/swaps": "Filename Type Size Used Priority",
    "/sys/kernel/mm/transparent_hugepage/enabled": "always [madvise] never",
    "/proc/sys/vm/compact_unevictable_allowed": "0",
    "/proc/sys/kernel/numa_balancing": "0",
    "/etc/hosts": "127.0.0.1 localhost",
    "/var/log/journal/x": "",
}
LOOP = Loop(cpu=3, priority=80, pid=PID)
STAT = "7 (spinner) S " + " ".join(["0"] * 36) + " 90 1 0 0"
CHANGES = [
    ("kernel preemption", "/sys/kernel/realtime", "0", Grade.BAD, "linux-image-rt-amd64"),
    ("real-time throttling", "/proc/sys/kernel/sched_rt_runtime_us", "950000", Grade.WARNING,
     "sched_rt_runtime_us=-1"),
    ("capabilities and limits", f"/proc/{PID}/status", "CapEff:\t0", Grade.BAD, "rtcfd.service"),
    ("locked memory", f"/proc/{PID}/status", "CapEff:\tffffffff\nVmLck:\t0 kB", Grade.WARNING,
     "rtcfctl start"),
    ("isolated CPU", f"{CPU}/isolated", "1", Grade.WARNING, "isolcpus=managed_irq,domain,3"),
    ("CPU without ticks", f"{CPU}/nohz_full", "", Grade.WARNING, "nohz_full=3"),
    ("interrupts", "/proc/irq/9/smp_affinity_list", "0-3", Grade.WARNING, "irqaffinity=0,1,2"),
    ("real-time competitors", "/proc/7/task/7/stat", STAT, Grade.WARNING, "taskset"),
    ("CPU frequency", f"{CPU}/cpu3/cpufreq/scaling_governor", "powersave", Grade.WARNING,
     "echo performance"),
    ("CPU idle states", f"{CPU}/cpu3/cpuidle/state0/latency", "133", Grade.WARNING, "udevadm"),
    ("SMT", f"{CPU}/cpu3/topology/thread_siblings_list", "1,3", Grade.WARNING, "cpu1/online"),
    ("clock source", "/sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet",
     Grade.WARNING, "dmesg"),
    ("transparent huge pages", "/sys/kernel/mm/transparent_hugepage/enabled",
     "[always] madvise never", Grade.WARNING, "echo madvise"),
    ("memory compaction", "/proc/sys/vm/compact_unevictable_allowed", "1", Grade.WARNING,
     "sysctl -w vm.compact_unevictable_allowed=0"),
    ("NUMA balancing", "/proc/sys/kernel/numa_balancing", "1", Grade.WARNING,
     "sysctl -w kernel.numa_balancing=0"),
    ("ROS environment", "/etc/hosts", "10.0.0.1 robot", Grade.WARNING, "127.0.0.1 localhost"),
    ("ROS environment", "/etc/default/rtcfd", "ROS_MASTER_URI=http://arm:11311", Grade.WARNING,
     "ROS_IP="),
]  # fmt: skip


def findings(root: Path, changes: dict[str, str], loop: Loop = LOOP) -> dict[str, Finding]:
    for name, text in (FIT | changes).items():
        file = root / name.lstrip("/")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return {finding.topic: finding for finding in diagnose(Host(root), loop)}


def test_a_good_machine_has_no_findings(tmp_path: Path) -> None:
    found = findings(tmp_path, {})
    assert {topic: each.found for topic, each in found.items() if each.grade != Grade.GOOD} == {}


@pytest.mark.parametrize(("topic", "file", "text", "grade", "remedy"), CHANGES)
def test_each_finding_follows_the_machine(
    tmp_path: Path, topic: str, file: str, text: str, grade: Grade, remedy: str
) -> None:
    found = findings(tmp_path, {file: text})
    assert found[topic].grade == grade, found[topic]
    assert remedy in found[topic].remedy
    assert found[topic].wanted
    assert {other for other, each in found.items() if each.grade > Grade.UNKNOWN} == {topic}


def test_a_full_disk_is_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rtcf.diagnosis.free_mib", lambda _: 99)
    found = findings(tmp_path, {"/var/lib/rtcfd/state.json": ""})
    for topic, remedy in (
        ("disk of state and incidents", "rtcfctl incident rm"),
        ("journal's disk", "journalctl --vacuum-size"),
    ):
        assert found[topic].grade == Grade.WARNING
        assert found[topic].found.startswith("99 MiB free at /var/l")
        assert remedy in found[topic].remedy


def test_it_names_the_free_space_at_which_a_recording_ends(daemon: DaemonUnderTest) -> None:
    said = daemon.ctl("doctor", "--seconds", "0").stdout
    assert "disk of recordings: " in said
    assert "; rtcfctl record ends at 100 MiB" in said


def test_swap_is_a_finding_for_an_unlocked_loop(tmp_path: Path) -> None:
    swaps = {"/proc/swaps": "Filename Type\n/dev/sda2 partition"}
    assert findings(tmp_path, swaps)["swap"].grade == Grade.GOOD
    loose = Loop(cpu=3, priority=80, pid=PID, lock_memory=False)
    assert findings(tmp_path, swaps, loose)["swap"].grade == Grade.BAD


def test_a_competitor_on_another_cpu_is_no_finding(tmp_path: Path) -> None:
    changes = {"/proc/7/task/7/stat": STAT, "/proc/7/task/7/status": "Cpus_allowed_list:\t0-2"}
    assert findings(tmp_path, changes)["real-time competitors"].grade == Grade.GOOD


def test_a_group_without_real_time_run_time_is_found(tmp_path: Path) -> None:
    changes = {
        "/sys/fs/cgroup/cpu/cpu.rt_runtime_us": "950000",
        "/sys/fs/cgroup/cpu/box/cpu.rt_runtime_us": "0",
        f"/proc/{PID}/cgroup": "4:cpu,cpuacct:/box",
    }
    found = findings(tmp_path, changes)["RT_GROUP_SCHED"]
    assert (found.grade, "/box has no real-time run time" in found.found) == (Grade.BAD, True)


def test_unreadable_files_are_reported_as_unknown_or_absent(tmp_path: Path) -> None:
    for finding in diagnose(Host(tmp_path), Loop(cpu=0, priority=80)):
        assert finding.found


def test_lists_of_cpus_are_parsed() -> None:
    assert cpus("0-2,5\n") == {0, 1, 2, 5}
    assert cpus("") == cpus("(null)") == set()


def test_a_real_measurement_gives_a_verdict_and_leaves_nothing(
    daemon: DaemonUnderTest,
) -> None:
    done = daemon.ctl("-o", "json", "doctor", "--seconds", "0.2")
    document = json.loads(done.stdout)
    grades = {each["topic"]: each["grade"] for each in document["findings"]}
    assert {"kernel preemption", "wake-up latency", "runner rt_runner"} <= set(grades)
    # The executor's own limits and memory are checked.
    for topic in ("capabilities and limits", "locked memory"):
        assert grades[topic] != "unknown", done.stdout
    # The verdict is also the exit code.
    assert done.returncode == {"good": 0, "warning": 4, "bad": 5}[document["verdict"]["grade"]]
    with daemon.client() as client:
        assert [each.runner for each in client.get_status().runners] == ["rt_runner"]


@pytest.mark.parametrize(
    ("grades", "code"),
    [
        ([Grade.GOOD, Grade.UNKNOWN], 0),
        ([Grade.WARNING, Grade.GOOD], 4),
        ([Grade.BAD, Grade.WARNING], 5),
    ],
)
def test_the_worst_grade_is_the_exit_code(grades: list[Grade], code: int) -> None:
    found = [Finding(f"topic {at}", grade, "so", "otherwise") for at, grade in enumerate(grades)]
    assert [doctor.report(found, None, Output(kind)) for kind in ("table", "json")] == [code, code]


@pytest.mark.parametrize(
    ("allowed", "isolated", "loops", "cpu"),
    [
        ("0-3", "", "", 3),
        ("0-2", "", "", 2),
        ("0-3", "1-2", "", 2),
        ("0-1", "2-3", "", 1),
        # Among the CPUs with the fewest loops.
        ("0-3", "", "3", 2),
        ("0-3", "1-2", "2", 1),
        ("0-3", "1-2", "1 2 13", 3),
        ("0-1", "", "0 1", 1),
        ("0-1", "", "0 1 1", 0),
        ("0", "", "0 0 0", 0),
    ],
)
def test_a_loop_without_cpu_uses_the_executors_choice(
    tmp_path: Path, allowed: str, isolated: str, loops: str, cpu: int
) -> None:
    changes = {
        f"/proc/{PID}/status": f"Name:\tx\nCpus_allowed_list:\t{allowed}\nMems_allowed_list:\t0",
        f"{CPU}/isolated": isolated,
    }
    findings(tmp_path, changes)
    taken = [int(each) for each in loops.split()]
    assert cpu_of_next_loop(Host(tmp_path), PID, taken) == cpu


def test_it_measures_on_the_loops_cpu_at_its_priority(
    daemon: DaemonUnderTest,
) -> None:
    cpu = min(os.sched_getaffinity(0))
    with daemon.client() as client:
        client.set_runner(runner_pb2.RunnerSettings(cpu=cpu, priority=63))
        done = daemon.ctl("-o", "json", "doctor", "--seconds", "0.2")
        found = {each["topic"]: each["found"] for each in json.loads(done.stdout)["findings"]}
        assert found["wake-up latency"].endswith(f" worst, on CPU {cpu} at priority 63 in 0.2 s")
        process = daemon.ctl_process("doctor", "--seconds", "3000")
        name = f"doctor_{process.pid}"

        def measured() -> Any:
            return next((each for each in client.get_status().runners if each.runner == name), None)

        loop = wait_for(measured, "its loop")
        assert (loop.settings.cpu, loop.settings.priority) == (cpu, 63)
        process.terminate()
        process.communicate()
        wait_for(lambda: measured() is None, "the end of its loop")


def test_it_works_without_rtcfd(tmp_path: Path, daemon: DaemonUnderTest) -> None:
    done = daemon.ctl("--socket", str(tmp_path / "none"), "doctor")
    assert done.returncode == 5
    assert "bad      rtcfd: rtcfd is not running" in done.stdout
    assert "kernel preemption" in done.stdout
    assert "not measured: rtcfd does not answer" in done.stdout


@root_only
@pytest.mark.parametrize("connects", [True, False])
def test_without_rights_it_names_the_missing_ones(connects: bool) -> None:
    program = (
        "import sys\n"
        "from rtcfctl.main import main\n"
        "sys.exit(main(['--socket', sys.argv[1], 'doctor', '--seconds', '0']))\n"
    )
    with open_to_strangers("[access]\ndefault = 'none'\n") as daemon:
        daemon.socket.chmod(0o666 if connects else 0o600)
        with stranger(program, str(daemon.socket)) as asking:
            said, _ = asking.communicate(timeout=60)
    (line,) = [each for each in said.splitlines() if " rtcfd: " in each]
    assert line.startswith("unknown  rtcfd: ")
    assert ("observe" if connects else "permission denied on") in line
    assert "systemctl start rtcfd" not in said


def test_a_state_that_cannot_be_saved_is_named(daemon: DaemonUnderTest) -> None:
    assert daemon.process is not None
    # No file can grow, as on a full disk.
    resource.prlimit(daemon.process.pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
    with daemon.client() as client:
        client.load(rtcf.component("demo", "Fine"))
    for verb in (("status",), ("doctor", "--seconds", "0")):
        assert "not saved: File too large" in " ".join(daemon.ctl(*verb).stdout.split())


def test_a_missing_runner_is_an_error_not_a_finding(daemon: DaemonUnderTest) -> None:
    done = daemon.ctl("-r", "none", "doctor", "--seconds", "0")
    assert (done.returncode, done.stdout) == (1, "")
    assert 'no runner "none"' in done.stderr


def test_no_test_loop_is_started_next_to_a_running_loop(daemon: DaemonUnderTest) -> None:
    with daemon.client() as client:
        client.add_runner("arm", runner_pb2.RunnerSettings(cpu=0))
        client.set_runner(runner_pb2.RunnerSettings(cpu=0))
        client.start("arm")
        said = daemon.ctl("doctor", "--seconds", "0.2").stdout
        assert "not measured: the loop of arm runs on CPU 0" in said
        # A running loop is better evidence than an empty one.
        said = daemon.ctl("-r", "arm", "doctor", "--seconds", "60").stdout
        assert "worst, of the running loop, 10 cycles" in said


def test_it_leaves_nothing_behind_when_it_is_ended(daemon: DaemonUnderTest) -> None:
    process = daemon.ctl_process("doctor", "--seconds", "3000")

    def runners() -> list[str]:
        return [each.runner for each in client.get_status().runners]

    with daemon.client() as client:
        wait_for(lambda: f"doctor_{process.pid}" in runners(), "its loop")
        process.terminate()
        process.communicate()
        wait_for(lambda: runners() == ["rt_runner"], "the end of its loop")
