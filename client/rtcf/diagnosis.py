"""Checks of a machine for real-time use, by /proc, /sys and /etc.

Each check returns the value found, the recommended value, and a command to change it.  All reads
go through a Host with a configurable root.
"""

import enum
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from rtcf_shared.disks import free_mib


class Grade(enum.IntEnum):
    """The severity of a finding."""

    GOOD = 0
    UNKNOWN = 1  # not visible to this process
    WARNING = 2  # increases latency, at least under load
    BAD = 3  # prevents real-time operation


@dataclass(frozen=True)
class Finding:
    """The result of one check."""

    topic: str
    grade: Grade
    found: str
    wanted: str = ""
    remedy: str = ""  # a command or advice; empty if none is needed


class Host:
    """The files of the machine below `root`."""

    def __init__(self, root: Path = Path("/")) -> None:
        self.root = root

    def read(self, path: str) -> str | None:
        """Return the stripped text of a file; None if it is not readable."""
        try:
            return (self.root / path.lstrip("/")).read_text(errors="replace").strip()
        except OSError:
            return None

    def glob(self, pattern: str) -> list[Path]:
        """Return the files that match a pattern, sorted."""
        return sorted(self.root.glob(pattern.lstrip("/")))


@dataclass(frozen=True, kw_only=True)
class Loop:
    """The loop for which the machine is checked."""

    cpu: int
    priority: int
    pid: int = 0  # of its executor; 0: none runs, or unknown
    hidden: bool = False  # rtcfd does not permit the caller to see the executor
    lock_memory: bool = True


def diagnose(host: Host, loop: Loop) -> list[Finding]:
    """Return all findings, in the recommended order of fixing them."""
    return [finding for check in _CHECKS for finding in check(host, loop)]


def cpus(text: str) -> set[int]:
    """Return the CPUs of a Linux CPU list such as "0-2,5"."""
    found: set[int] = set()
    for part in filter(None, text.replace("\n", ",").split(",")):
        low, _, high = part.partition("-")
        if low.strip().isdigit() and (not high or high.strip().isdigit()):
            found |= set(range(int(low), int(high or low) + 1))
    return found


def cpu_of_next_loop(host: Host, pid: int, taken: Iterable[int] = ()) -> int | None:
    """Return the CPU that the next loop without a CPU setting gets, as in cpu_claim.cpp.

    Among the allowed CPUs of process `pid`, those with the fewest loops are preferred, then
    isolated ones, then the last one.  `taken` has the CPU of each loop of the daemon.
    """
    match = re.search(r"^Cpus_allowed_list:\s*(\S+)", host.read(f"/proc/{pid}/status") or "", re.M)
    if not match or not (allowed := cpus(match[1])):
        return None
    isolated = cpus(host.read("/sys/devices/system/cpu/isolated") or "")
    best_first = sorted(allowed, key=lambda cpu: (cpu not in isolated, -cpu))
    loops = Counter(taken)
    return min(best_first, key=lambda cpu: loops[cpu])


def _kernel(host: Host, _: Loop) -> Iterator[Finding]:
    topic = "kernel preemption"
    if host.read("/sys/kernel/realtime") == "1":
        yield Finding(topic, Grade.GOOD, "PREEMPT_RT")
        return
    version = host.read("/proc/version") or ""
    model = re.search(r"\bPREEMPT\w*", version)
    yield Finding(
        topic,
        Grade.BAD,
        model[0] if model else "no preemption",
        "PREEMPT_RT: otherwise latency is unbounded",
        "apt install linux-image-rt-amd64, and boot it",
    )


def _throttling(host: Host, _: Loop) -> Iterator[Finding]:
    topic = "real-time throttling"
    runtime = host.read("/proc/sys/kernel/sched_rt_runtime_us")
    period = host.read("/proc/sys/kernel/sched_rt_period_us")
    if runtime is None or period is None:
        yield Finding(topic, Grade.UNKNOWN, "not readable")
    elif runtime == "-1" or int(runtime) >= int(period):
        yield Finding(topic, Grade.GOOD, "off")
    else:
        yield Finding(
            topic,
            Grade.WARNING,
            f"real-time threads stop after {runtime} of {period} µs",
            "off, if spinning or overruns can occupy a CPU for that long",
            "sysctl -w kernel.sched_rt_runtime_us=-1",
        )


def _group_scheduling(host: Host, loop: Loop) -> Iterator[Finding]:
    topic = "RT_GROUP_SCHED"
    release = host.read("/proc/sys/kernel/osrelease") or ""
    config = host.read(f"/boot/config-{release}")
    files = host.glob("/sys/fs/cgroup/cpu*/cpu.rt_runtime_us")
    built = bool(files) or bool(config and "CONFIG_RT_GROUP_SCHED=y" in config)
    if not built:
        grade = Grade.GOOD if config is not None or host.glob("/sys/fs/cgroup") else Grade.UNKNOWN
        yield Finding(topic, grade, "not in use" if grade == Grade.GOOD else "not readable")
        return
    group = _v1_cpu_group(host, loop.pid)
    runtime = host.read(f"/sys/fs/cgroup/cpu{group}/cpu.rt_runtime_us")
    if group in ("", "/") or (runtime or "0") != "0":
        yield Finding(topic, Grade.GOOD, f"in use; group {group or '/'} has real-time run time")
        return
    yield Finding(
        topic,
        Grade.BAD,
        f"group {group} has no real-time run time: it cannot use SCHED_FIFO",
        "run time for rtcfd's group, or a kernel without RT_GROUP_SCHED (Debian's)",
        f"echo 950000 > /sys/fs/cgroup/cpu{group}/cpu.rt_runtime_us",
    )


def _v1_cpu_group(host: Host, pid: int) -> str:
    for line in (host.read(f"/proc/{pid or 'self'}/cgroup") or "").splitlines():
        _, controllers, group = [*line.split(":", 2), "", ""][:3]
        if "cpu" in controllers.split(","):
            return group
    return ""


def _rights(host: Host, loop: Loop) -> Iterator[Finding]:
    topic = "capabilities and limits"
    if loop.hidden:
        yield Finding(topic, Grade.UNKNOWN, "rtcfd does not report the executor")
        return
    if not loop.pid:
        yield Finding(topic, Grade.UNKNOWN, "no executor runs", "", "systemctl start rtcfd")
        return
    status = host.read(f"/proc/{loop.pid}/status") or ""
    limits = host.read(f"/proc/{loop.pid}/limits") or ""
    effective = re.search(r"^CapEff:\s*([0-9a-f]+)", status, re.M)
    mask = int(effective[1], 16) if effective else 0
    priority = re.search(r"^Max realtime priority\s+(\S+)", limits, re.M)
    memory = re.search(r"^Max locked memory\s+(\S+)", limits, re.M)
    missing = []
    if not mask & 1 << _CAP_SYS_NICE and not (
        priority and (priority[1] == "unlimited" or int(priority[1]) >= loop.priority)
    ):
        missing.append(f"SCHED_FIFO {loop.priority} (CAP_SYS_NICE or LimitRTPRIO=)")
    if not mask & 1 << _CAP_IPC_LOCK and not (memory and memory[1] == "unlimited"):
        missing.append("locked memory (CAP_IPC_LOCK or LimitMEMLOCK=infinity)")
    if missing:
        yield Finding(
            topic,
            Grade.BAD,
            f"executor {loop.pid} lacks {', '.join(missing)}",
            "both",
            "use rtcfd.service, which grants both",
        )
    else:
        yield Finding(topic, Grade.GOOD, "SCHED_FIFO and locked memory are permitted")


_CAP_IPC_LOCK, _CAP_SYS_NICE = 14, 23  # linux/capability.h


def _locked(host: Host, loop: Loop) -> Iterator[Finding]:
    topic = "locked memory"
    status = host.read(f"/proc/{loop.pid}/status") if loop.pid else None
    found = re.search(r"^VmLck:\s*(\d+) kB", status or "", re.M)
    if loop.hidden:
        yield Finding(topic, Grade.UNKNOWN, "rtcfd does not report the executor")
    elif found is None:
        yield Finding(topic, Grade.UNKNOWN, "no executor runs")
    elif int(found[1]):
        yield Finding(topic, Grade.GOOD, f"{int(found[1]) // 1024} MiB of the executor")
    else:
        remedy = "" if loop.lock_memory else "rtcfctl runner set --lock-memory"
        yield Finding(
            topic,
            Grade.WARNING,
            "the executor's memory is not locked (it is while its loop runs)",
            "locked: a page fault delays a cycle",
            remedy or "rtcfctl start",
        )


def _governor(host: Host, loop: Loop) -> Iterator[Finding]:
    topic = "CPU frequency"
    folder = f"/sys/devices/system/cpu/cpu{loop.cpu}/cpufreq"
    governor = host.read(f"{folder}/scaling_governor")
    if governor is None:
        yield Finding(topic, Grade.GOOD, f"CPU {loop.cpu} is not scaled by Linux")
    elif governor == "performance":
        yield Finding(topic, Grade.GOOD, f"governor of CPU {loop.cpu} is performance")
    else:
        yield Finding(
            topic,
            Grade.WARNING,
            f"governor of CPU {loop.cpu} is {governor}",
            "performance: cycles take longer on a slow CPU",
            f"echo performance > {folder}/scaling_governor",
        )


_DEEP_US = 20  # exit latency above which an idle state is reported


def _idle_states(host: Host, loop: Loop) -> Iterator[Finding]:
    topic = "CPU idle states"
    folder = f"/sys/devices/system/cpu/cpu{loop.cpu}/cpuidle"
    deep = []
    for state in host.glob(f"{folder}/state*"):
        here = "/" + str(state.relative_to(host.root))
        latency = int(host.read(f"{here}/latency") or 0)
        if latency > _DEEP_US and host.read(f"{here}/disable") != "1":
            deep.append(f"{host.read(f'{here}/name')} ({latency} µs)")
    device = host.root / "dev/cpu_dma_latency"
    held = device.exists() and device.stat().st_mode & 0o060 == 0o060
    if not deep:
        yield Finding(topic, Grade.GOOD, f"CPU {loop.cpu} has no deep idle states")
    elif held:
        yield Finding(topic, Grade.GOOD, f"{', '.join(deep)}; running loops keep the CPU awake")
    else:
        yield Finding(
            topic,
            Grade.WARNING,
            f"CPU {loop.cpu} can enter {', '.join(deep)}; loops are not permitted to prevent it",
            "/dev/cpu_dma_latency for group rtcf",
            "udevadm trigger /dev/cpu_dma_latency",
        )


def _isolation(host: Host, loop: Loop) -> Iterator[Finding]:
    for name, topic in (("isolated", "isolated CPU"), ("nohz_full", "CPU without ticks")):
        text = host.read(f"/sys/devices/system/cpu/{name}")
        here = loop.cpu in cpus(text or "")
        if here:
            yield Finding(topic, Grade.GOOD, f"CPU {loop.cpu} is in {name} ({text})")
        elif len(cpus(host.read("/sys/devices/system/cpu/online") or "0")) < 2:
            yield Finding(topic, Grade.GOOD, "the machine has only one CPU")
        else:
            option = "isolcpus=managed_irq,domain," if name == "isolated" else "nohz_full="
            yield Finding(
                topic,
                Grade.WARNING,
                f"CPU {loop.cpu} is shared with other processes"
                if name == "isolated"
                else f"CPU {loop.cpu} is interrupted by the scheduler's tick",
                f"CPU {loop.cpu} reserved for the loop",
                f"add {option}{loop.cpu} to GRUB_CMDLINE_LINUX in /etc/default/grub; update-grub",
            )


def _interrupts(host: Host, loop: Loop) -> Iterator[Finding]:
    topic = "interrupts"
    online = cpus(host.read("/sys/devices/system/cpu/online") or "0")
    here = []
    for folder in host.glob("/proc/irq/[0-9]*"):
        number = folder.name
        effective = host.read(f"/proc/irq/{number}/effective_affinity_list")
        text = effective or host.read(f"/proc/irq/{number}/smp_affinity_list") or ""
        # Ignore interrupts without a handler.
        used = any(entry.is_dir() for entry in folder.iterdir())
        if used and loop.cpu in cpus(text):
            here.append(number)
    others = ",".join(str(cpu) for cpu in sorted(online - {loop.cpu}))
    if not here or not others:
        found = "none" if not here else f"{len(here)}, but there is no other CPU"
        yield Finding(topic, Grade.GOOD, f"on CPU {loop.cpu}: {found}")
    else:
        yield Finding(
            topic,
            Grade.WARNING,
            f"CPU {loop.cpu} handles {len(here)}: {', '.join(here[:8])}"
            + (" …" if len(here) > 8 else ""),
            "none on the loop's CPU",
            f"add irqaffinity={others} to GRUB_CMDLINE_LINUX; until then: for i in "
            f"{' '.join(here)}; do echo {others} > /proc/irq/$i/smp_affinity_list; done",
        )


def _competitors(host: Host, loop: Loop) -> Iterator[Finding]:
    topic = "real-time competitors"
    rivals = []
    for stat in host.glob("/proc/[0-9]*/task/[0-9]*/stat"):
        here = "/" + str(stat.relative_to(host.root))
        text = host.read(here) or ""
        name = text[text.find("(") + 1 : text.rfind(")")]
        rest = text.rpartition(")")[2].split()
        # proc(5): rt_priority is field 40, policy 41; the rest begins with field 3.
        if len(rest) < 39 or rest[38] not in ("1", "2", "6") or int(rest[37]) < loop.priority:
            continue
        if int(stat.parts[-4]) == loop.pid or _may_not_run(host, here, loop.cpu):
            continue
        # Indispensable threads of the kernel, one on each CPU.
        if name.startswith(("migration/", "idle_inject/", "stopper/")):
            continue
        rivals.append(f"{name} ({rest[37]})")
    if not rivals:
        yield Finding(topic, Grade.GOOD, f"none at {loop.priority} or above on CPU {loop.cpu}")
    else:
        yield Finding(
            topic,
            Grade.WARNING,
            f"on CPU {loop.cpu} at {loop.priority} or above: {', '.join(sorted(set(rivals)))}",
            "none",
            "move them to another CPU (taskset), or raise the loop's --priority",
        )


def _may_not_run(host: Host, stat: str, cpu: int) -> bool:
    status = host.read(stat.removesuffix("stat") + "status") or ""
    allowed = re.search(r"^Cpus_allowed_list:\s*(\S+)", status, re.M)
    return allowed is not None and cpu not in cpus(allowed[1])


def _smt(host: Host, loop: Loop) -> Iterator[Finding]:
    topic = "SMT"
    text = host.read(f"/sys/devices/system/cpu/cpu{loop.cpu}/topology/thread_siblings_list")
    siblings = cpus(text or "") - {loop.cpu}
    if not siblings:
        yield Finding(topic, Grade.GOOD, f"CPU {loop.cpu} does not share its core")
        return
    others = ",".join(map(str, sorted(siblings)))
    yield Finding(
        topic,
        Grade.WARNING,
        f"CPU {loop.cpu} shares its core with CPU {others}",
        "a separate core",
        f"echo 0 > /sys/devices/system/cpu/cpu{min(siblings)}/online",
    )


def _clock(host: Host, _: Loop) -> Iterator[Finding]:
    topic = "clock source"
    source = host.read("/sys/devices/system/clocksource/clocksource0/current_clocksource")
    if source is None:
        yield Finding(topic, Grade.UNKNOWN, "not readable")
    elif source in ("tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page"):
        yield Finding(topic, Grade.GOOD, source)
    else:
        yield Finding(
            topic,
            Grade.WARNING,
            f"{source}: reading the time is slow",
            "tsc",
            "find the cause with `dmesg | grep -i tsc`; a firmware update can help",
        )


def _swap(host: Host, loop: Loop) -> Iterator[Finding]:
    topic = "swap"
    areas = [line.split()[0] for line in (host.read("/proc/swaps") or "").splitlines()[1:]]
    if not areas:
        yield Finding(topic, Grade.GOOD, "none")
    elif loop.lock_memory:
        yield Finding(topic, Grade.GOOD, f"{', '.join(areas)}; executors are locked in memory")
    else:
        yield Finding(
            topic,
            Grade.BAD,
            f"{', '.join(areas)}, and memory locking is off for the executor",
            "locked memory, or no swap",
            "rtcfctl runner set --lock-memory; or swapoff -a",
        )


def _settings_of_memory(host: Host, _: Loop) -> Iterator[Finding]:
    thp = host.read("/sys/kernel/mm/transparent_hugepage/enabled")
    chosen = re.search(r"\[(\w+)\]", thp or "")
    if chosen and chosen[1] == "always":
        yield Finding(
            "transparent huge pages",
            Grade.WARNING,
            "always: the kernel moves memory while loops run",
            "madvise or never",
            "echo madvise > /sys/kernel/mm/transparent_hugepage/enabled",
        )
    else:
        yield Finding("transparent huge pages", Grade.GOOD, chosen[1] if chosen else "none")
    for name, topic, why in (
        ("vm.compact_unevictable_allowed", "memory compaction", "the kernel moves locked pages"),
        ("kernel.numa_balancing", "NUMA balancing", "the kernel unmaps pages to track accesses"),
    ):
        value = host.read("/proc/sys/" + name.replace(".", "/"))
        if value in (None, "0"):
            yield Finding(topic, Grade.GOOD, "not available" if value is None else f"{name} = 0")
        else:
            yield Finding(
                topic,
                Grade.WARNING,
                f"{name} = {value}: {why}",
                "0",
                f"sysctl -w {name}=0",
            )


_STATE = "var/lib/rtcfd"
_WANTED_MIB = 500


def disk(topic: str, folder: Path, remedy: str, shown: str = "", note: str = "") -> Finding:
    """Return the finding on the free space on the disk of a folder; `note` follows the space."""
    free = free_mib(folder)
    found = f"{free} MiB free at {shown or folder}{note}"
    if free >= _WANTED_MIB:
        return Finding(topic, Grade.GOOD, found)
    return Finding(topic, Grade.WARNING, found, f"{_WANTED_MIB} MiB", remedy)


def _disks(host: Host, _: Loop) -> Iterator[Finding]:
    if (state := host.root / _STATE).is_dir():
        remedy = "rtcfctl incident rm, or lower incidents_mb in /etc/rtcfd/rtcfd.toml"
        yield disk("disk of state and incidents", state, remedy, f"/{_STATE}")
    topic = "journal's disk"
    for folder in ("var/log/journal", "run/log/journal"):
        if (path := host.root / folder).is_dir():
            yield disk(topic, path, "journalctl --vacuum-size=100M", f"/{folder}")
            return
    yield Finding(topic, Grade.WARNING, "no journal", "a journal", "apt install systemd")


def _ros(host: Host, _: Loop) -> Iterator[Finding]:
    topic = "ROS environment"
    hosts = host.read("/etc/hosts") or ""
    if not re.search(r"^\s*127\.\S+\s.*\blocalhost\b", hosts, re.M):
        yield Finding(
            topic,
            Grade.WARNING,
            "/etc/hosts has no localhost: ROS nodes cannot find each other",
            "127.0.0.1 localhost",
            "echo 127.0.0.1 localhost >> /etc/hosts",
        )
        return
    defaults = host.read("/etc/default/rtcfd") or ""
    master = re.search(r"^\s*ROS_MASTER_URI=(\S+)", defaults, re.M)
    remote = master is not None and not re.search(r"//(localhost|127\.)", master[1])
    if remote and not re.search(r"^\s*ROS_(IP|HOSTNAME)=", defaults, re.M):
        yield Finding(
            topic,
            Grade.WARNING,
            f"the master at {master[1] if master else ''} does not know this machine's address",
            "ROS_IP or ROS_HOSTNAME",
            "echo ROS_IP=<this machine's address> >> /etc/default/rtcfd",
        )
    else:
        yield Finding(topic, Grade.GOOD, f"master: {master[1] if master else 'set by each runner'}")


_CHECKS: tuple[Callable[[Host, Loop], Iterator[Finding]], ...] = (
    _kernel, _rights, _locked, _throttling, _group_scheduling, _isolation, _interrupts,
    _competitors, _governor, _idle_states, _smt, _clock, _swap, _settings_of_memory, _disks,
    _ros,
)  # fmt: skip
