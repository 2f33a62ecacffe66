"""Components of rtcf_control in C++ and in Python, each against the other."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from daemon_process import BUILD_TREE
from pages import TREE
from rtcf.testing import Bench
from rtcf.v1 import runner_pb2
from values import port_value, wait_until_after

SOURCES = TREE / "components" / "rtcf_control" / "python"
ROUNDING = 1e-12  # relative, of values of size 1
STEPS = 2000
# Steps, noise, and values that are not finite.
SIGNAL = np.repeat(np.random.default_rng(7).normal(0.0, 2.0, STEPS // 50), 50)
SIGNAL = SIGNAL + 0.2 * np.random.default_rng(8).normal(size=STEPS)
SIGNAL[[100, 101, 700, 1500]] = np.nan, np.inf, -np.inf, np.nan
CYCLE = np.arange(STEPS)
RESET = CYCLE % 600 > 590
LOAD = np.where(CYCLE > 900, 0.3, 0.0)
_MASKED: Any = np.ma
# A caller that renews `run` each 20 cycles, begins each 500, and is silent from cycle 1200 on.
RUN = _MASKED.array(CYCLE % 500 >= 20, mask=(CYCLE % 20 > 0) | ((CYCLE > 1200) & (CYCLE < 1500)))
# A source that is slower than the loop for a while, and then stops.
SLOW = _MASKED.array(SIGNAL, mask=((CYCLE > 500) & (CYCLE % 10 > 0)) | (CYCLE > 1600))
# A sensor that is silent or frozen for a while.
SEEN = _MASKED.array(np.sin(0.02 * np.where(CYCLE % 900 < 600, CYCLE, 600)),
                     mask=(CYCLE > 200) & (CYCLE < 480))  # fmt: skip
LAW: dict[str, Any] = {"coulomb": 2.0, "breakaway": 3.5, "viscous": 0.8, "stribeck_velocity": 0.05}
MOTOR: dict[str, Any] = {"inertia": 0.05, "viscous": 0.5, "step": 5e-4}
ELASTIC: dict[str, Any] = {**MOTOR, "load_inertia": 0.1, "stiffness": 200.0, "damping": 0.5}
DRY: dict[str, Any] = {"coulomb": 0.5, "static_friction": 0.9, "stribeck_velocity": 0.5}
WINDING: dict[str, Any] = {"drive": "voltage", "torque_constant": 0.5, "resistance": 0.4}
# A command that pauses twice.
COMMAND = _MASKED.array(SIGNAL, mask=(CYCLE % 900 > 250) & (CYCLE % 900 < 400))
PAUSES: dict[str, Any] = {"timeout": 0.05, "safe_value": 0.2, "stop_rate": 20.0, "resume_rate": 9.0}
ANGLE = 1.2 * np.sin(0.01 * CYCLE)
ANGLE[[200, 1300]] = np.nan, np.inf
JOINT: dict[str, Any] = {"lower": -1.0, "upper": 1.1, "max_velocity": 6.0, "deceleration": 30.0}
SOFT: dict[str, Any] = {**JOINT, "soft_lower": -0.8, "soft_upper": 0.9}
EXCITED: dict[str, Any] = {"lower": -9.0, "upper": 9.0, "duration": 0.3}

# By pair: the parameters of both, and of the one in C++ if they differ.
PAIRS: list[tuple[str, str, Mapping[str, Any], Mapping[str, Any] | None]] = [
    ("Saturation", "Saturation", {"lower": -1.0, "upper": 1.5}, None),
    ("Saturation", "Saturation", {}, None),
    ("RateLimiter", "RateLimiter", {"rising": 20.0, "falling": 50.0}, None),
    ("RateLimiter", "RateLimiter", {}, None),
    ("DeadBand", "DeadBand", {"lower": -0.5, "upper": 0.2}, None),
    ("Backlash", "Backlash", {"width": 0.7}, None),
    ("Hysteresis", "Hysteresis", {"low": -0.5, "high": 0.4, "initial": True}, None),
    ("Integrator", "Integrator", {"gain": 3.0, "initial": 0.1, "upper": 1.0}, None),
    ("Integrator", "Integrator", {"method": "euler"}, None),
    ("Derivative", "Derivative", {"gain": 0.3, "filter_time": 0.01}, None),
    ("Derivative", "Derivative", {}, None),
    ("MovingAverage", "MovingAverage", {"length": 37}, None),
    ("MovingAverage", "MovingAverage", {"length": 1}, None),
    ("Biquads", "Biquad", {"kind": "lowpass", "f": 40.0, "q": 0.9}, {"sections": "lowpass 40 0.9"}),
    ("Biquads", "Biquad", {"kind": "highpass", "f": 5.0, "q": 0.6}, {"sections": "highpass 5 0.6"}),
    ("Biquads", "Biquad", {"kind": "bandpass", "f": 30.0, "q": 3.0}, {"sections": "bandpass 30 3"}),
    ("Biquads", "Biquad", {"kind": "notch", "f": 90.0, "q": 5.0}, {"sections": "notch 90 5"}),
    ("FrictionCompensation", "FrictionCompensation", LAW, None),
    ("FrictionCompensation", "FrictionCompensation", {}, None),
    ("FrictionCompensation", "FrictionCompensation",
     {**LAW, "breakaway": 0.0, "stribeck_exponent": 0.7, "share": 0.8, "max_effort": 2.2}, None),
    ("Motor", "Motor", {**MOTOR, "load_inertia": 0.1}, None),
    ("Motor", "Motor", {**ELASTIC, **DRY}, None),
    ("Motor", "Motor", {**MOTOR, **DRY, "torque_limit": 3.0, "encoder": 4096.0}, None),
    ("Motor", "Motor", {**MOTOR, **WINDING}, None),
    ("Motor", "Motor", {**ELASTIC, **DRY, **WINDING, "inductance": 0.01}, None),
    ("Excitation", "Excitation", {**EXCITED, "shape": "step", "delay": 0.05}, None),
    ("Excitation", "Excitation", {**EXCITED, "shape": "relay", "hysteresis": 0.3}, None),
    ("Excitation", "Excitation", {**EXCITED, "shape": "relay", "frozen_timeout": 0.05}, None),
    ("Excitation", "Excitation", {**EXCITED, "shape": "step", "mode": "replace", "lease": 0.1,
     "measured_lower": -0.9}, None),
    ("Excitation", "Excitation", {**EXCITED, "shape": "multisine", "lines": 7}, None),
    *(("Excitation", "Excitation", {**EXCITED, "shape": shape, "frequency_hz": 30.0},
       {**EXCITED, "shape": shape, "frequency": 30.0})
      for shape in ("prbs", "linear_chirp", "log_chirp")),
    ("Excitation", "Excitation", {}, None),
    ("CommandTimeout", "CommandTimeout", PAUSES, None),
    ("CommandTimeout", "CommandTimeout", {**PAUSES, "latching": False}, None),
    ("JointLimiter", "JointLimiter", {}, None),
    ("JointLimiter", "JointLimiter", {**SOFT, "command": "velocity"}, None),
    ("JointLimiter", "JointLimiter", {"command": "effort", "max_effort": 1.0}, None),
    ("JointLimiter", "JointLimiter",
     {"lower": -1.0, "upper": 1.1, "command": "velocity", "measurement_timeout": 0.0,
      "frozen_timeout": 0.003}, None),
    ("JointLimiter", "JointLimiter", {**SOFT, "command": "effort", "k_velocity": 0.3}, None),
    ("JointLimiter", "JointLimiter", {**SOFT, "deceleration": 1e5}, None),
]  # fmt: skip
# By component in C++: its ports and those in Python, and the values of inputs.
INPUTS: dict[str, dict[str, tuple[str, Any]]] = {
    "Integrator": {"in": ("u", SIGNAL), "reset": ("reset", RESET)},
    "Derivative": {"in": ("u", SLOW)},
    "FrictionCompensation": {"velocity": ("velocity", SIGNAL)},
    "Motor": {"command": ("command", SIGNAL), "load_torque": ("load_torque", LOAD)},
    "Excitation": {
        "in": ("u", SIGNAL),
        "measured": ("measured", SEEN),
        "run": ("run", RUN),
        "stop": ("stop_now", CYCLE % 900 > 890),
    },
    "CommandTimeout": {"in": ("u", COMMAND), "reset": ("reset", RESET)},
    "JointLimiter": {
        "in": ("u", SIGNAL),
        "position": ("position", ANGLE),
        "velocity": ("velocity", 12.0 * np.cos(0.01 * CYCLE)),
    },
}
OUTPUTS = {
    "Saturation": {"out": "y", "saturated": "saturated"},
    "RateLimiter": {"out": "y", "limited": "limited"},
    "FrictionCompensation": {"effort": "effort"},
    "Motor": {
        name: name for name in ("position", "velocity", "load_position", "load_velocity", "torque")
    },
    "CommandTimeout": {"stopped": "stopped", "state": "state", "age": "age", "out": "y"},
    "JointLimiter": {"out": "y", "limited": "limited"},
    "Excitation": {"signal": "signal", "state": "state", "running": "running", "out": "y"},
}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return a folder of packages with the components in Python, compiled, as package `pairs`."""
    folder = tmp_path_factory.mktemp("pairs")
    (folder / "pairs").mkdir()
    subprocess.run(
        [BUILD_TREE / "bin" / "rtcf-compile", *sorted(SOURCES.glob("*.py")),
         "-o", folder / "pairs" / "pairs.so"],
        check=True,
    )  # fmt: skip
    yield folder


def _line(
    name: str,
    package: str,
    type_: str,
    parameters: Mapping[str, Any],
    remaps: Mapping[str, str] | None = None,
) -> str:
    """Return a component of a graph file, in its own namespace."""
    given = ", ".join(f"{key}: {value!r}" for key, value in parameters.items())
    named = ", ".join(f"{key}: {value}" for key, value in (remaps or {}).items())
    line = f"  - {{name: {name}, ns: /{name}, package: {package}, type: {type_}, " \
           f"parameters: {{{given}}}, remaps: {{{named}}}}}\n"  # fmt: skip
    return line.replace("True", "true")


@pytest.mark.parametrize(("cpp", "python", "parameters", "other"), PAIRS)
def test_both_have_the_same_outputs(
    compiled: Path,
    tmp_path: Path,
    cpp: str,
    python: str,
    parameters: Mapping[str, Any],
    other: Mapping[str, Any] | None,
) -> None:
    file = tmp_path / "pair.yaml"
    file.write_text(
        "components:\n"
        + _line("cpp", "rtcf_control", cpp, other or parameters)
        + _line("python", "pairs", python, parameters)
    )
    inputs: dict[str, Any] = {}
    for ours, (theirs, values) in INPUTS.get(cpp, {"in": ("u", SIGNAL)}).items():
        inputs |= {f"/cpp/cpp.{ours}": values, f"/python/python.{theirs}": values}
    with Bench(str(file), path=[BUILD_TREE / "lib" / "rtcf", compiled]) as bench:
        found = bench.run(inputs)
    for ours, theirs in OUTPUTS.get(cpp, {"out": "y"}).items():
        one, two = found[f"/cpp/cpp.{ours}"], found[f"/python/python.{theirs}"]
        assert np.allclose(
            one.astype(float), two.astype(float), rtol=0, atol=ROUNDING, equal_nan=True
        ), ours
        assert len(np.unique(one.astype(float))) > 1 or not parameters, ours


def test_both_fade_after_a_change_of_parameters(compiled: Path, tmp_path: Path) -> None:
    type_ = "FrictionCompensation"
    file = tmp_path / "pair.yaml"
    file.write_text(
        "components:\n"
        + _line("cpp", "rtcf_control", type_, {**LAW, "fade": 0.02})
        + _line("python", "pairs", type_, {**LAW, "fade": 0.02})
    )
    changes = {10: {"coulomb": 3.0}, 20: {"viscous": 2.0}, 50: {"fade": 0.0, "share": 0.5}}
    efforts = []
    with Bench(str(file), path=[BUILD_TREE / "lib" / "rtcf", compiled]) as bench:
        for cycle in range(60):
            for name in ("/cpp/cpp", "/python/python"):
                bench.client.write(f"{name}.velocity", 1.0 + 0.5 * math.sin(0.1 * cycle))
                if cycle in changes:
                    bench.set(name, **changes[cycle])
            bench.client.step(1)
            efforts.append([port_value(bench.client, name, "effort")
                            for name in ("/cpp/cpp", "/python/python")])  # fmt: skip
    one, two = np.array(efforts).T
    assert np.allclose(one, two, rtol=0, atol=ROUNDING)
    assert abs(one[50] - one[49]) > 1.0 > np.max(np.abs(np.diff(one[5:50])))


@pytest.mark.parametrize("kind", ["lowpass", "bandpass"])
def test_both_filters_are_the_same_at_another_period(
    compiled: Path, tmp_path: Path, kind: str
) -> None:
    file = tmp_path / "pair.yaml"
    file.write_text(
        "components:\n"
        + _line("cpp", "rtcf_control", "Biquads", {"sections": f"{kind} 30 3"})
        + _line("python", "pairs", "Biquad", {"kind": kind, "f": 30.0, "q": 3.0})
    )
    outputs = []
    with Bench(str(file), path=[BUILD_TREE / "lib" / "rtcf", compiled]) as bench:
        for cycle in range(60):
            if cycle == 40:
                bench.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=250))
            for name in ("/cpp/cpp.in", "/python/python.u"):
                bench.client.write(name, math.sin(0.3 * cycle))
            bench.client.step(1)
            outputs.append([port_value(bench.client, "/cpp/cpp", "out"),
                            port_value(bench.client, "/python/python", "y")])  # fmt: skip
    one, two = np.array(outputs).T
    assert np.allclose(one, two, rtol=0, atol=ROUNDING)


def test_both_are_the_same_in_the_last_cycle(compiled: Path, tmp_path: Path) -> None:
    safe = 0.25
    source = {"in_manual": True, "manual_value": 0.1, "safe_effort": safe}
    lines = [_line("source", "rtcf_control", "Pid", source, {"effort": "/command"})]
    by_type = {cpp: (python, parameters, other) for cpp, python, parameters, other in PAIRS}
    for cpp, (python, parameters, other) in by_type.items():
        one, (two, _) = next(iter(INPUTS.get(cpp, {"in": ("u", 0.0)}).items()))
        lines += [
            _line(f"cpp_{cpp}", "rtcf_control", cpp, other or parameters, {one: "/command"}),
            _line(f"python_{cpp}", "pairs", python, parameters, {two: "/command"}),
        ]
    file = tmp_path / "pairs.yaml"
    file.write_text("components:\n" + "".join(lines))
    found: dict[str, str] = {}
    with Bench(str(file), path=[BUILD_TREE / "lib" / "rtcf", compiled]) as bench:
        bench.client.start()
        wait_until_after(bench.client, 2)
        bench.client.stop()
        for each in bench.client.list_components():
            for port in bench.client.get_component(each.full_name).ports:
                found[f"{each.full_name.rpartition('/')[2]}.{port.name}"] = port.value
    for cpp in by_type:
        for ours, theirs in OUTPUTS.get(cpp, {"out": "y"}).items():
            assert found[f"cpp_{cpp}.{ours}"] == found[f"python_{cpp}.{theirs}"] != "", cpp
    assert found["cpp_Saturation.out"] == f"data: {safe}"


def test_the_sources_are_the_compiled_pairs() -> None:
    written = {
        line.removeprefix("class ").split("(")[0]
        for file in SOURCES.glob("*.py")
        for line in file.read_text().splitlines()
        if line.startswith("class ") and line.endswith(("(Component):", "(_Block):"))
    }
    assert written - {"_Block"} == {python for _, python, _, _ in PAIRS}
