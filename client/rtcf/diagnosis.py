"""What stands between a machine and real time: read from /proc, /sys and /etc.

Each check gives what was found, what it should be, and the command that mends
it.  All reads go through a Host, whose root a test may choose.
"""

import enum
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path


class Grade(enum.IntEnum):
    """How bad a finding is."""

    GOOD = 0
    UNKNOWN = 1  # it cannot be seen from here
    WARNING = 2  # costs latency, or will under load
    BAD = 3  # no real time with it


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    topic: str
    grade: Grade
    found: str
    wanted: str = ""
    remedy: str = ""  # a command, or what to do; empty: nothing


class Host:
    """The machine's files; `root` is where they are."""

    def __init__(self, root: Path = Path("/")) -> None:
        self.root = root

    def read(self, path: str) -> str | None:
        """Return a file's text without the space around it, or None where it cannot be read."""
        try:
            return (self.root / path.lstrip("/")).read_text(errors="replace").strip()
        except OSError:
            return None

    def glob(self, pattern: str) -> list[Path]:
        """Return the files of a pattern."""
        return sorted(self.root.glob(pattern.lstrip("/")))


@dataclass(frozen=True)
class Loop:
    """The loop that the machine is judged for."""

    cpu: int
    priority: int
    pid: int = 0  # of its executor; 0: none runs, or we are not told
    hidden: bool = False  # we are not told
    lock_memory: bool = True


def diagnose(host: Host, loop: Loop) -> list[Finding]:
    """Return all findings, in the order in which they are best mended."""
    return [finding for check in _CHECKS for finding in check(host, loop)]


def cpus(text: str) -> set[int]:
    """Return the CPUs of a list as Linux writes it: "0-2,5"."""
    found: set[int] = set()
    for part in filter(None, text.replace("\n", ",").split(",")):
        low, _, high = part.partition("-")
        if low.strip().isdigit() and (not high or high.strip().isdigit()):
            found |= set(range(int(low), int(high or low) + 1))
    return found


def cpu_of_next_loop(host: Host, pid: int, taken: Iterable[int] = ()) -> int | None:
    """Return the CPU that a loop gets which may choose among those of a process: of those with
    the fewest loops an isolated one, else the last.  As executors do (cpu_claim.cpp).

    `taken`: the CPU of each loop of the daemon.
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
        "PREEMPT_RT: else latency has no bound",
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
            f"loops stand still after {runtime} of {period} µs",
            "off, if a loop with spin, or an overrun, may use a CPU for long",
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
        f"group {group} has no real-time run time: SCHED_FIFO is refused there",
        "run time for rtcfd's group, or a kernel without it (Debian's)",
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
        yield Finding(topic, Grade.UNKNOWN, "rtcfd does not say which executor runs")
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
            "run it by rtcfd.service, which gives them",
        )
    else:
        yield Finding(topic, Grade.GOOD, "SCHED_FIFO and locked memory are allowed")


_CAP_IPC_LOCK, _CAP_SYS_NICE = 14, 23  # linux/capability.h


def _locked(host: Host, loop: Loop) -> Iterator[Finding]:
    topic = "locked memory"
    status = host.read(f"/proc/{loop.pid}/status") if loop.pid else None
    found = re.search(r"^VmLck:\s*(\d+) kB", status or "", re.M)
    if loop.hidden:
        yield Finding(topic, Grade.UNKNOWN, "rtcfd does not say which executor runs")
    elif found is None:
        yield Finding(topic, Grade.UNKNOWN, "no executor runs")
    elif int(found[1]):
        yield Finding(topic, Grade.GOOD, f"{int(found[1]) // 1024} MiB of the executor")
    else:
        remedy = "" if loop.lock_memory else "rtcfctl runner set --lock-memory"
        yield Finding(
            topic,
            Grade.WARNING,
            "nothing of the executor is locked (it is when its loop has started)",
            "all of it: a page fault costs a cycle",
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
            "performance: a slow CPU makes a cycle long",
            f"echo performance > {folder}/scaling_governor",
        )


_DEEP_US = 20  # exit latency from which an idle state shows


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
        yield Finding(topic, Grade.GOOD, f"CPU {loop.cpu} has none that takes long to leave")
    elif held:
        yield Finding(topic, Grade.GOOD, f"{', '.join(deep)}; loops that run keep the CPU awake")
    else:
        yield Finding(
            topic,
            Grade.WARNING,
            f"CPU {loop.cpu} may go to {', '.join(deep)}, and loops may not keep it awake",
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
            yield Finding(topic, Grade.GOOD, "there is one CPU only")
        else:
            option = "isolcpus=managed_irq,domain," if name == "isolated" else "nohz_full="
            yield Finding(
                topic,
                Grade.WARNING,
                f"CPU {loop.cpu} is shared with all that runs"
                if name == "isolated"
                else f"CPU {loop.cpu} is interrupted by the scheduler's tick",
                f"CPU {loop.cpu} for the loop alone",
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
        # One without a handler goes nowhere.
        used = any(entry.is_dir() for entry in folder.iterdir())
        if used and loop.cpu in cpus(text):
            here.append(number)
    others = ",".join(str(cpu) for cpu in sorted(online - {loop.cpu}))
    if not here or not others:
        found = "none" if not here else f"{len(here)}, and there is no other CPU"
        yield Finding(topic, Grade.GOOD, f"on CPU {loop.cpu}: {found}")
    else:
        yield Finding(
            topic,
            Grade.WARNING,
            f"{len(here)} come to CPU {loop.cpu}: {', '.join(here[:8])}"
            + (" …" if len(here) > 8 else ""),
            "none on the loop's CPU",
            f"add irqaffinity={others} to GRUB_CMDLINE_LINUX; now: for i in {' '.join(here)}; do "
            f"echo {others} > /proc/irq/$i/smp_affinity_list; done",
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
        # The kernel's own, one on each CPU, which nobody can do without.
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
            "give them another CPU (taskset), or the loop a higher --priority",
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
        yield Finding(topic, Grade.GOOD, f"CPU {loop.cpu} has its core for itself")
        return
    others = ",".join(map(str, sorted(siblings)))
    yield Finding(
        topic,
        Grade.WARNING,
        f"CPU {loop.cpu} shares its core with CPU {others}",
        "a core for itself",
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
            "look for why in `dmesg | grep -i tsc`; the firmware may mend it",
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
            f"{', '.join(areas)}, and the executor's memory is not to be locked",
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
            "always: memory is moved while loops run",
            "madvise or never",
            "echo madvise > /sys/kernel/mm/transparent_hugepage/enabled",
        )
    else:
        yield Finding("transparent huge pages", Grade.GOOD, chosen[1] if chosen else "none")
    for name, topic, why in (
        ("vm.compact_unevictable_allowed", "memory compaction", "locked pages are moved"),
        ("kernel.numa_balancing", "NUMA balancing", "pages are unmapped to see who uses them"),
    ):
        value = host.read("/proc/sys/" + name.replace(".", "/"))
        if value in (None, "0"):
            yield Finding(topic, Grade.GOOD, "not there" if value is None else f"{name} = 0")
        else:
            yield Finding(
                topic,
                Grade.WARNING,
                f"{name} = {value}: {why}",
                "0",
                f"sysctl -w {name}=0",
            )


_JOURNAL_MIB = 500


def _journal(host: Host, _: Loop) -> Iterator[Finding]:
    topic = "journal's disk"
    for folder in ("var/log/journal", "run/log/journal"):
        path = host.root / folder
        if not path.is_dir():
            continue
        found = os.statvfs(path)
        free_mib = found.f_bavail * found.f_frsize // 2**20
        if free_mib >= _JOURNAL_MIB:
            yield Finding(topic, Grade.GOOD, f"{free_mib} MiB free at /{folder}")
        else:
            yield Finding(
                topic,
                Grade.WARNING,
                f"{free_mib} MiB free at /{folder}",
                f"{_JOURNAL_MIB} MiB",
                "journalctl --vacuum-size=100M",
            )
        return
    yield Finding(topic, Grade.WARNING, "there is no journal", "one", "apt install systemd")


def _ros(host: Host, _: Loop) -> Iterator[Finding]:
    topic = "ROS environment"
    hosts = host.read("/etc/hosts") or ""
    if not re.search(r"^\s*127\.\S+\s.*\blocalhost\b", hosts, re.M):
        yield Finding(
            topic,
            Grade.WARNING,
            "/etc/hosts has no localhost: ROS nodes do not find each other",
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
            f"the master is at {master[1] if master else ''}, and it is not told how to reach us",
            "ROS_IP or ROS_HOSTNAME",
            "echo ROS_IP=<this machine's address> >> /etc/default/rtcfd",
        )
    else:
        yield Finding(topic, Grade.GOOD, f"master {master[1] if master else 'of each runner'}")


_CHECKS: tuple[Callable[[Host, Loop], Iterator[Finding]], ...] = (
    _kernel, _rights, _locked, _throttling, _group_scheduling, _isolation, _interrupts,
    _competitors, _governor, _idle_states, _smt, _clock, _swap, _settings_of_memory, _journal,
    _ros,
)  # fmt: skip
