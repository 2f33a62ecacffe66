"""Plots on the pages of rtcf_control, drawn from runs of the components.

A plot follows the line `<!-- plot: NAME -->`, as a block of code. RTCF_DRAW_PLOTS=1 writes them.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from block_bench import PATH
from daemon_process import Daemon
from documentation_commands import typed
from pages import TREE
from rtcf.testing import Bench
from rtcfctl.terminal import drawings

PAGES = TREE / "docs" / "control"
WIDTH = 72
DT = 0.001  # s
MASKED: Any = np.ma

_PID = """\
components:
  - {name: pid, package: rtcf_control, type: Pid, breaks: [measured],
     remaps: {measured: /position, effort: /speed},
     parameters: {kp: 4.0, ki: 8.0, setpoint_weight: 0.5, upper: 1.5}}
  - {name: plant, package: rtcf_control, type: Integrator,
     remaps: {in: /speed, out: /position}}
"""

_LQG = """\
components:
  - {name: plant, package: rtcf_control, type: StateSpace, breaks: [in1],
     remaps: {in1: /force, out1: /position, out2: /angle},
     parameters: {A: "0 1 0 0; 0 -0.1 2 0; 0 0 0 1; 0 -0.3 30 0", B: "0; 1; 0; 3",
                  C: "1 0 0 0; 0 0 1 0", initial: "0 0 0.05 0"}}
  - {name: controller, package: rtcf_control, type: StateSpace,
     remaps: {measured1: /position, measured2: /angle, out1: /force},
     parameters: {A: "0 1 0 0; 0 -0.1 2 0; 0 0 0 1; 0 -0.3 30 0", B: "0; 1; 0; 3",
                  C: "1 0 0 0; 0 0 1 0", role: lqg, tracked: "1",
                  process_noise: "0.01 1 0.01 1", measurement_noise: "1e-4",
                  state_cost: "10 1 10 1", input_cost: "0.1"}}
"""


def drawn(title: str, values: Any, marks: Mapping[float, str]) -> str:
    """Return a curve from its first value on."""
    return "\n".join(drawings.drawn(title, [values[np.isfinite(values)]], marks))


def _run(folder: Path, graph: str, inputs: Mapping[str, Any]) -> Any:
    """Return the outputs of a graph."""
    file = folder / "loop.yaml"
    file.write_text(graph)
    with Bench(str(file), path=PATH) as bench:
        return bench.run(inputs)


def _pid(folder: Path) -> str:
    setpoint = np.where(np.arange(4000) < 2000, 1.0, 0.0)
    found = _run(folder, _PID, {"/pid.setpoint": setpoint})
    marks = {0.0: "0 s: setpoint 1", 0.5: "2 s: setpoint 0", 1.0: "4 s"}
    return "\n\n".join(
        [drawn("position", found["/plant.out"], marks), drawn("speed", found["/pid.effort"], marks)]
    )


def _biquads(_: Path) -> str:
    with Bench("rtcf_control/Biquads", path=PATH, sections="lowpass 50 0.707; notch 120 5",
               settled=False) as bench:  # fmt: skip
        impulse = np.zeros(8192)
        impulse[0] = 1.0
        response = np.abs(np.fft.rfft(bench.run({"in": impulse})["out"]))
    frequencies = np.geomspace(5.0, 400.0, 2 * WIDTH)
    spectrum = np.interp(frequencies, np.fft.rfftfreq(8192, DT), response)
    decibels = np.round(20.0 * np.log10(spectrum), 2) + 0.0  # no -0
    marks = {0.0: "5 Hz"}
    marks |= {float(np.log(f / 5.0) / np.log(80.0)): f"{f} Hz" for f in (50, 120)}
    return drawn("gain in dB of lowpass 50 0.707; notch 120 5", decibels, marks | {1.0: "400 Hz"})


def _trajectory(_: Path) -> str:
    with Bench("rtcf_control/TrajectoryGenerator", path=PATH, initial="0", velocity="1",
               acceleration="4", jerk="40") as bench:  # fmt: skip
        targets = np.zeros((2000, 1))
        targets[[0, 600], 0] = 1.0, 0.2
        sent = np.isin(np.arange(2000), [0, 600])[:, None]
        found = bench.run({"target.position": MASKED.array(targets, mask=~sent)})
    marks = {0.0: "0 s: target 1", 0.3: "0.6 s: target 0.2", 1.0: "2 s"}
    names = {"position": "positions", "velocity": "velocities", "acceleration": "accelerations"}
    return "\n\n".join(
        drawn(title, found[f"point.{name}"][:, 0], marks) for title, name in names.items()
    )


def _joint_limiter(_: Path) -> str:
    with Bench("rtcf_control/JointLimiter", path=PATH, upper=1.0, max_velocity=2.0,
               deceleration=4.0) as bench:  # fmt: skip
        found = bench.run({"in": np.full(1200, 3.0), "position": 0.0})
    marks = {0.0: "0 s: command 3, upper = 1", 1.0: "1.2 s"}
    velocity = np.diff(found["out"], prepend=0.0) / DT
    return "\n\n".join([drawn("out", found["out"], marks), drawn("velocity", velocity, marks)])


def _motor(_: Path) -> str:
    with Bench("rtcf_control/Motor", path=PATH, inertia=1e-4, load_inertia=4e-4, stiffness=5.0,
               damping=2e-3, viscous=1e-3, coulomb=0.02,
               static_friction=0.03) as bench:  # fmt: skip
        found = bench.run({"command": np.where(np.arange(500) < 250, 0.06, 0.0)})
    marks = {0.0: "0 s: 0.06 N m", 0.5: "0.25 s: 0 N m", 1.0: "0.5 s"}
    return "\n\n".join(
        drawn(f"{name} in rad/s", found[name], marks) for name in ("velocity", "load_velocity")
    )


def _state_space(folder: Path) -> str:
    setpoint = np.where(np.arange(16000) < 8000, 0.0, 0.3)
    found = _run(folder, _LQG, {"/controller.in1": setpoint})
    marks = {0.0: "0 s: angle 0.05", 0.5: "8 s: setpoint 0.3", 1.0: "16 s"}
    names = {"position in m": "/plant.out1", "angle in rad": "/plant.out2"}
    return "\n\n".join(drawn(title, found[name], marks) for title, name in names.items())


def _kalman_filter(_: Path) -> str:
    with Bench("rtcf_control/KalmanFilter", path=PATH, A="0 1; 0 0", B="", C="1 0",
               process_noise="0 1", measurement_noise="1e-4") as bench:  # fmt: skip
        cycles = np.arange(1200)
        missing = (cycles % 20 != 0) | ((cycles >= 500) & (cycles < 800))
        found = bench.run({"measured1": MASKED.array(np.zeros(1200), mask=missing)})
    marks = {0.0: "0.2 s", 0.3: "0.5 s", 0.6: "0.8 s", 1.0: "1.2 s"}
    return drawn("deviation1", found["deviation1"][200:], marks)


def _example(folder: Path) -> Mapping[str, str]:
    """Return the output of the first identify and tune of the page of the motor, by verb."""
    text = (PAGES / "motor.md").read_text()
    (graph,) = re.findall(r"^```yaml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    (folder / "motor.yaml").write_text(graph)
    found: dict[str, str] = {}
    daemon = Daemon(folder)
    daemon.start()
    try:
        for line in typed("control/motor.md"):
            words = [str(folder / each) if each == "motor.yaml" else each for each in line.split()]
            done = daemon.run(*words)
            assert done.returncode == 0, f"{line}\n{done.stderr}"
            found[words[1]] = done.stdout
            if words[1] == "tune":
                break
    finally:
        daemon.end()
    return found


def _identify(folder: Path) -> str:
    plots = _example(folder)["identify"]
    return plots[plots.index("gain in dB") : plots.index("residuals")].rstrip()


def _tune(folder: Path) -> str:
    plots = _example(folder)["tune"]
    return plots[: plots.index("set kp")].rstrip()


def _friction(_: Path) -> str:
    with Bench("rtcf_control/FrictionCompensation", path=PATH, coulomb=2.0, breakaway=3.0,
               viscous=0.5) as bench:  # fmt: skip
        found = bench.run({"velocity": np.linspace(-0.5, 0.5, 2001)})
    marks = {0.0: "-0.5 rad/s", 0.5: "0", 1.0: "0.5 rad/s"}
    return drawn("effort in N m by velocity", found["effort"], marks)


_JOINTS = """\
components:
  - {name: arm, package: rtcf_control, type: TrajectoryGenerator, remaps: {command: /command},
     parameters: {joints: shoulder elbow, initial: 0 0.5}}
  - {name: split, package: rtcf_control, type: JointCommandSubscriber,
     remaps: {command: /command, position1: /shoulder, position2: /elbow},
     parameters: {joints: shoulder elbow}}
  - {name: elbow_limiter, package: rtcf_control, type: JointLimiter,
     remaps: {in: /elbow, out: /elbow_limited}, parameters: {upper: 0.8}}
  - {name: state, package: rtcf_control, type: JointStatePublisher,
     remaps: {position1: /shoulder, position2: /elbow_limited},
     parameters: {joints: shoulder elbow}}
"""


def _joints(folder: Path) -> str:
    target = MASKED.array(np.tile([-0.5, 1.0], (2500, 1)), mask=np.ones((2500, 2), bool))
    target.mask[0] = False
    position = _run(folder, _JOINTS, {"/arm.target.position": target})["/state.state.position"]
    marks = {0.0: "0 s: target -0.5, 1", 1.0: "2.5 s"}
    return "\n\n".join(
        drawn(name, position[:, index], marks) for index, name in enumerate(["shoulder", "elbow"])
    )


_LINK = (
    '<link name="{}"><inertial><origin xyz="0.5 0 0"/><mass value="1"/><inertia ixx="0" ixy="0" '
    'ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>'
)
_TWO_LINKS = (
    '<robot name="arm"><link name="base"/>' + _LINK.format("upper") + _LINK.format("fore") +
    '<joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/>'
    '<axis xyz="0 -1 0"/></joint><joint name="elbow" type="continuous"><origin xyz="1 0 0"/>'
    '<parent link="upper"/><child link="fore"/><axis xyz="0 -1 0"/></joint></robot>'
)  # fmt: skip


def _gravity(_: Path) -> str:
    with Bench("rtcf_control/GravityCompensation", path=PATH, urdf=_TWO_LINKS) as bench:
        shoulder = np.linspace(0.0, 2.0 * np.pi, 2001)
        position = np.stack([shoulder, np.zeros(2001)], axis=1)
        effort = bench.run({"measured.position": position})["command.effort"]
    marks = {0.0: "0", 0.5: "180 degrees", 1.0: "360 degrees"}
    return "\n\n".join(
        drawn(f"effort of {name} in N m", effort[:, index], marks)
        for index, name in enumerate(["shoulder", "elbow"])
    )


PLOTS: dict[str, tuple[str, Callable[[Path], str]]] = {
    "pid": ("pid.md", _pid),
    "biquads": ("biquads.md", _biquads),
    "state-space": ("state_space.md", _state_space),
    "kalman-filter": ("kalman_filter.md", _kalman_filter),
    "trajectory": ("trajectory.md", _trajectory),
    "joint-limiter": ("safety.md", _joint_limiter),
    "motor": ("motor.md", _motor),
    "identify": ("motor.md", _identify),
    "tune": ("motor.md", _tune),
    "friction": ("friction.md", _friction),
    "joints": ("joints.md", _joints),
    "gravity": ("gravity.md", _gravity),
}


@pytest.mark.parametrize("name", PLOTS)
def test_a_page_shows_the_plot_of_its_component(tmp_path: Path, name: str) -> None:
    page, draw = PLOTS[name]
    text = (PAGES / page).read_text()
    block = re.search(rf"<!-- plot: {name} -->\n+```\n(.*?)\n```\n", text, re.DOTALL)
    assert block, f"{page} has no plot {name}"
    plot = draw(tmp_path)
    if os.environ.get("RTCF_DRAW_PLOTS"):
        begin, end = block.span(1)
        (PAGES / page).write_text(text[:begin] + plot + text[end:])
        return
    assert block[1] == plot


def test_each_plot_on_the_pages_is_drawn_here() -> None:
    found = {
        name: page.name
        for page in PAGES.glob("*.md")
        for name in re.findall(r"<!-- plot: (.*) -->", page.read_text())
    }
    assert found == {name: page for name, (page, _) in PLOTS.items()}
