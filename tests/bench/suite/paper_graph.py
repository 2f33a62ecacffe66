"""Runs of Fig. 1 of the paper and of chains in real time: in rtcf's loop and in LinuxCNC HAL."""

import contextlib
import json
import os
import re
import subprocess
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from processes import Failed, output_of
from quantiles import Samples
from setting import FREQUENCY_HZ, PRIORITY, Setting

_HAL = Path(__file__).resolve().parent.parent / "hal"
_MODULES = Path("/usr/lib/linuxcnc/modules")
HAL_MIMO = "rtcf_mimo"  # sums only new values, as rtcf's Mimo
HAL_SUM = "rtcf_sum"  # sums all values
HAL_COMPONENTS = (HAL_MIMO, HAL_SUM, "rtcf_record")
_SKIP_S = 1.5  # during which the threads get their priority
_NOBODY = 65534


@dataclass
class PaperRun:
    """The cycles of one run of rtcf."""

    durations_ns: Samples
    latencies_ns: Samples
    missed: int


def run_rtcf(
    setting: Setting,
    seconds: float,
    frequency_hz: int = FREQUENCY_HZ,
    spin_us: int = 0,
    samples: Path | None = None,
    length: int = 0,
) -> PaperRun:
    """Run Fig. 1 in rtcf, or a chain. `samples` is the file for durations and latencies."""
    file = samples or setting.output / "rtcf.samples"
    command = [
        *(setting.program("paper_run"), str(setting.library), str(frequency_hz), str(seconds)),
        *(str(PRIORITY), str(setting.cpu), str(spin_us), str(file)),
        *([str(length)] if length else []),
    ]
    found = json.loads(output_of(command, seconds))
    pairs = np.fromfile(file, sep=" ")
    return PaperRun(pairs[0::2], pairs[1::2], found["missed"])


@dataclass
class HalRun:
    """The cycles of one run of HAL."""

    durations_ns: Samples
    ends_ns: Samples  # from the deadline to the end of the cycle, the recorder's time included


@contextlib.contextmanager
def hal_components(setting: Setting) -> Iterator[None]:
    """Build HAL's Mimo and link it into the machine's only HAL folder for the block."""
    folder = setting.output / "hal"
    folder.mkdir(parents=True, exist_ok=True)
    for name in HAL_COMPONENTS:
        (folder / f"{name}.comp").write_bytes((_HAL / f"{name}.comp").read_bytes())
        source = ["halcompile", "--compile", f"{name}.comp"]
        done = subprocess.run(source, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise Failed(f"halcompile {name}: {done.stderr.strip()}")
    links = [_MODULES / f"{name}.so" for name in HAL_COMPONENTS]
    try:
        for name, link in zip(HAL_COMPONENTS, links, strict=True):
            link.unlink(missing_ok=True)
            link.symlink_to((folder / f"{name}.so").resolve())
        yield
    except PermissionError:
        raise Failed(f"no permission to write {_MODULES}: HAL's benches need root") from None
    finally:
        for link in links:
            with contextlib.suppress(OSError):
                link.unlink()


def _chain(component: str, length: int) -> str:
    """Return the lines of a HAL file for a chain, in place of those for Fig. 1."""
    name = component.replace("_", "-")
    nets = []
    for i in range(1, length):
        nets.append(f"net c{i} {name}.{i - 1}.out1 => {name}.{i}.in1")
        if component == HAL_MIMO:
            nets.append(f"net n{i} {name}.{i - 1}.out1-count => {name}.{i}.in1-count")
    functions = [f"addf {name}.{i} cycle" for i in range(length)]
    return "\n".join([*nets, *functions])


def _hal_file(component: str, length: int, values: dict[str, str]) -> str:
    """Return the text of a HAL file. `length` is that of a chain; 0 = Fig. 1."""
    text = (_HAL / "fig1.hal.in").read_text()
    if length:
        text = text.replace("names=H1,F1,R1,R2,R3", f"count={length}")
        own = re.compile(r"(@COUNTS@)?(net \S+ [HFR]\d|newsig|sets|net r3-h1|addf [HFR])")
        lines = [line for line in text.splitlines() if not own.match(line)]
        place = next(i for i, line in enumerate(lines) if line.startswith("net thread-time"))
        text = "\n".join([*lines[:place], _chain(component, length), *lines[place:], ""])
    for key, value in values.items():
        text = text.replace(f"@{key}@", value)
    return text


def run_hal(
    seconds: float,
    component: str = HAL_MIMO,
    frequency_hz: int = FREQUENCY_HZ,
    length: int = 0,
) -> HalRun:
    """Run Fig. 1 in HAL, or a chain, within hal_components()."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o777)  # HAL drops its privileges before it writes
        skip = int(_SKIP_S * frequency_hz)
        values = {
            "COMPONENT": component,
            "COUNTS": "" if component == HAL_MIMO else "# ",
            "SAMPLES": str(folder / "samples"),
            "SKIP": str(skip),
            "PERIOD_NS": str(1_000_000_000 // frequency_hz),
            "SECONDS": str(seconds + _SKIP_S),
        }
        (folder / "fig1.hal").write_text(_hal_file(component, length, values))
        environment = {
            **os.environ,
            "RTAPI_UID": str(_NOBODY),
            "RTAPI_FIFO_PATH": str(folder / "fifo"),
            "LINUXCNC_FORCE_REALTIME": "1",
        }
        with (folder / "log").open("w") as log:
            process = subprocess.Popen(
                ["halrun", str(folder / "fig1.hal")], env=environment, stdout=log, stderr=log
            )
            try:
                _make_realtime(process, deadline_s=_SKIP_S)
                process.wait(seconds + 60)
            except subprocess.TimeoutExpired:
                raise Failed("halrun does not end") from None
            finally:
                if process.poll() is None:
                    process.terminate()
                    process.wait()
                    subprocess.run(
                        ["halrun", "-U"], env=environment, capture_output=True, check=False
                    )
        if process.returncode != 0 or not (folder / "samples").exists():
            raise Failed(f"halrun: {(folder / 'log').read_text().strip()}")
        pairs = np.fromfile(folder / "samples", sep=" ")
        return HalRun(pairs[0::2], pairs[1::2])


def _make_realtime(process: "subprocess.Popen[bytes]", deadline_s: float) -> None:
    """Return HAL's threads rtcf's priority where HAL itself does not.

    HAL first requests I/O privileges, which many virtual machines refuse; it then continues
    without real time.
    """
    deadline = time.monotonic() + deadline_s
    while time.monotonic() < deadline and process.poll() is None:
        for thread in _other_threads("rtapi_app"):
            with contextlib.suppress(ProcessLookupError):
                if os.sched_getscheduler(thread) != os.SCHED_FIFO:
                    os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(PRIORITY))
        time.sleep(0.02)


def _other_threads(program: str) -> list[int]:
    """Return all threads but the first of each process that runs this program."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if os.readlink(folder / "exe").endswith(f"/{program}"):
                threads = [int(thread.name) for thread in (folder / "task").iterdir()]
                found += [thread for thread in threads if thread != int(folder.name)]
    return found
