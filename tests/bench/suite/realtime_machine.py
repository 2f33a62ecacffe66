"""Fig. 1 and cyclictest in the virtual PREEMPT_RT machine of rt/rtvm."""

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from instructions import FIG_1_INSTRUCTIONS
from paper_graph import HAL_COMPONENTS, hal_components
from processes import Failed, missing, output_of
from quantiles import Samples, median_of, summary
from result import Budget, Cell, Result
from setting import Setting

_RT = Path(__file__).resolve().parent.parent / "rt"
_HAL = Path(__file__).resolve().parent.parent / "hal"
_HAL_PROGRAMS = ("/usr/bin/halrun", "/usr/bin/halcmd", "/usr/bin/rtapi_app")
_BOOT_S = 3000.0  # on a busy host
_INSTRUCTION_NS = 2.0
_KINDS = ("idle", "stress-ng")


def run(setting: Setting, boots: int) -> Result:
    """Boot `boots` times; return the medians over the boots."""
    if absent := missing("qemu-system-x86_64", "mmdebstrap", "mke2fs", "debugfs"):
        raise Failed(absent)
    cache = setting.build / "rtvm"
    output_of([str(_RT / "rtvm"), "image", str(cache)], _BOOT_S)
    found: dict[str, list[list[float]]] = {}
    with tempfile.TemporaryDirectory() as name:
        payload = Path(name)
        with_hal = _fill(payload, setting)
        for boot in range(boots):
            folder = setting.output / f"rt-boot-{boot + 1}"
            shutil.rmtree(folder, ignore_errors=True)
            command = [str(_RT / "rtvm"), "run", str(cache), str(payload), str(folder)]
            done = subprocess.run(command, timeout=_BOOT_S, check=False)
            if done.returncode != 0:
                raise Failed(f"the virtual machine failed; see {folder}/log")
            for key, samples in _read(folder, with_hal).items():
                found.setdefault(key, []).append(summary(samples, 1e-3))
    return _report({key: median_of(runs) for key, runs in found.items()}, boots, with_hal)


def _report(found: dict[str, list[float]], boots: int, with_hal: bool) -> Result:
    result = Result(
        "realtime_machine",
        f"PREEMPT_RT, instruction-counted time, median of {boots} boots, virtual µs",
        ["", "p50", "p99", "p99.9", "max"],
    )
    for kind in _KINDS:
        result.rows += [
            [f"{title}, {kind}", *_cells(found.get(f"{key}.{kind}"))]
            for key, title in (
                ("rtcf.duration", "calculation, rtcf"),
                ("hal.duration", "calculation, LinuxCNC HAL"),
                ("hal-sums.duration", "calculation, LinuxCNC HAL, plain sums"),
                ("cyclictest", "wake-up, cyclictest"),
                ("rtcf.latency", "wake-up, rtcf"),
                ("rtcf-spin.latency", "wake-up, rtcf with spin"),
            )
        ]
        ours, theirs = found[f"rtcf.latency.{kind}"], found[f"cyclictest.{kind}"]
        duration = found[f"rtcf.duration.{kind}"]
        result.budgets.append(
            Budget(
                f"Fig. 1, calculation p50, {kind}",
                duration[0] * 1e3 / _INSTRUCTION_NS,
                FIG_1_INSTRUCTIONS,
                "instructions",
            )
        )
        if with_hal:
            limit = found[f"hal.duration.{kind}"][2]
            result.budgets.append(
                Budget(f"Fig. 1, calculation p99.9, {kind}, limit: HAL's", duration[2], limit, "µs")
            )
        result.budgets += [
            Budget(f"wake-up p99.9, {kind}, cyclictest + 2 µs", ours[2], theirs[2] + 2, "µs"),
            Budget(f"wake-up maximum, {kind}, cyclictest + 3 µs", ours[3], theirs[3] + 3, "µs"),
            Budget(
                f"wake-up p99 with spin, {kind}", found[f"rtcf-spin.latency.{kind}"][1], 0.2, "µs"
            ),
        ]
    result.notes.append("rtcf and HAL sum only new values; plain sums add all values")
    return result


def _cells(values: list[float] | None) -> list[Cell]:
    return [None] * 4 if values is None else list(values)


def _read(folder: Path, with_hal: bool) -> dict[str, Samples]:
    """Return all samples of a boot in ns, by quantity and load."""
    found = {}
    for kind in _KINDS:
        for name in ("rtcf", "rtcf-spin"):
            pairs = np.fromfile(folder / f"{name}.{kind}", sep=" ")
            found[f"{name}.duration.{kind}"] = pairs[0::2]
            found[f"{name}.latency.{kind}"] = pairs[1::2]
        lines = (folder / f"cyclictest.{kind}").read_text().splitlines()
        fields = [line.split(":") for line in lines if line.count(":") == 2]
        latencies = [float(field[2]) for field in fields if field[2].strip().isdigit()]
        found[f"cyclictest.{kind}"] = np.array(latencies)
        if with_hal:
            for name in ("hal", "hal-sums"):
                pairs = np.fromfile(folder / f"{name}.{kind}", sep=" ")
                found[f"{name}.duration.{kind}"] = pairs[0::2]
    return found


def _fill(payload: Path, setting: Setting) -> bool:
    """Copy all files for the machine into the folder. @return whether HAL is included"""
    shutil.copy(_RT / "run.sh", payload)
    shutil.copy(setting.program("paper_run"), payload)
    shutil.copy(setting.library, payload)
    binaries = [setting.program("paper_run"), str(setting.library)]
    files: set[str] = set()
    with_hal = not missing("halrun", "halcompile")
    if with_hal:
        with hal_components(setting):
            pass  # only to build them
        shutil.copy(_HAL / "fig1.hal.in", payload)
        modules = Path("/usr/lib/linuxcnc/modules")
        kept = [str(modules / name) for name in ("hal_lib.so", "threads.so")]
        files |= {*_HAL_PROGRAMS, *kept, "/usr/lib/linuxcnc/realtime"}
        files |= {str(file) for file in Path("/etc/linuxcnc").glob("*.conf")}
        binaries += ["/usr/bin/halcmd", "/usr/bin/rtapi_app", *kept]
    for binary in binaries:
        for line in output_of(["ldd", binary]).splitlines():
            files |= {word for word in line.split() if word.startswith("/")}
    command = ["tar", "-cf", str(payload / "files.tar"), "--dereference", "-C", "/"]
    # Where /lib is a link, the files are in /usr/lib.
    names = sorted({f"usr{file}" if file.startswith("/lib") else file[1:] for file in files})
    output_of([*command, *names])
    if with_hal:
        folder = setting.output / "hal"
        names = [f"{name}.so" for name in HAL_COMPONENTS]
        place = "--transform=s,^,usr/lib/linuxcnc/modules/,"
        output_of(["tar", "-rf", str(payload / "files.tar"), place, "-C", str(folder), *names])
    return with_hal
