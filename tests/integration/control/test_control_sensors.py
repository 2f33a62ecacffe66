"""Dead and wrong sensors: the outputs of each component with a measured input.

The time from the last good value to the safe output is that of the table in docs/control/index.md.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import rtcf
from block_bench import Blocks, Stepped, Values
from pages import TREE
from rtcf.testing import Bench
from rtcf.v1 import graph_pb2
from rtcf_shared.value_text import parse

DT = 0.001
LENGTH = 900
RETURN = 600  # cycle in which the sensor works again
TIMEOUT = 0.2  # of all components but KalmanFilter
MASKED: Any = np.ma


@dataclass
class Case:
    """A component with measured inputs, and its output."""

    component: str
    measured: tuple[str, ...]
    output: str
    safe: float
    largest: float  # size of the output
    inputs: Values
    parameters: Values
    slows_s: float = 0.0  # time from the loss to the safe output
    changes: float = np.inf  # largest change of the output in a cycle
    holds: bool = False  # a value that is not finite holds the output


PLANT = {"A": "0 1; -4 -1", "B": "0; 4", "lower": "-3", "upper": "2", "safe_value": "0.5"}
CASES = {
    "Pid": Case(
        "Pid", ("measured",), "effort", 0.25, 4.0, {"setpoint": 9.0},
        {"kp": 2.0, "ki": 5.0, "kd": 0.1, "lower": -4.0, "upper": 4.0, "safe_effort": 0.25},
        holds=True,
    ),
    "Pid with a rate": Case(
        "Pid", ("measured",), "effort", 0.25, 4.0, {"setpoint": 9.0},
        {"kp": 2.0, "ki": 5.0, "kd": 0.1, "lower": -4.0, "upper": 4.0, "safe_effort": 0.25,
         "rate": 50.0},
        slows_s=8.0 / 50.0, changes=0.05 + 1e-9, holds=True,
    ),
    "JointLimiter of a velocity": Case(
        "JointLimiter", ("position",), "out", 0.0, 1.5, {"in": 9.0},
        {"command": "velocity", "lower": -2.0, "upper": 2.0, "max_velocity": 1.5,
         "deceleration": 20.0},
        slows_s=1.5 / 20.0, changes=0.02 + 1e-9,
    ),
    "JointLimiter of an effort": Case(
        "JointLimiter", ("position", "velocity"), "out", 0.0, 7.0, {"in": 9.0},
        {"command": "effort", "lower": -2.0, "upper": 2.0, "max_velocity": 3.0,
         "deceleration": 20.0, "k_velocity": 5.0, "max_effort": 7.0},
    ),
    "FrictionCompensation": Case(
        "FrictionCompensation", ("velocity",), "effort", 0.0, 2.0, {},
        {"coulomb": 1.0, "viscous": 3.0, "max_effort": 2.0},
    ),
    "StateSpace, regulator": Case(
        "StateSpace", ("measured1", "measured2"), "out1", 0.5, 3.0, {},
        {**PLANT, "role": "regulator", "C": "1 0; 0 1", "fade": 0.0}, holds=True,
    ),
    "StateSpace, lqg": Case(
        "StateSpace", ("measured1",), "out1", 0.5, 3.0, {},
        {**PLANT, "role": "lqg", "C": "1 0", "fade": 0.0}, holds=True,
    ),
}  # fmt: skip
TYPES = (
    "Pid", "JointLimiter", "FrictionCompensation", "StateSpace", "KalmanFilter", "Excitation"
)  # fmt: skip


def dead(values: Any, begin: int) -> Any:
    """Return a column without values during a fault."""
    cycles = np.arange(LENGTH)
    return MASKED.array(values, mask=(cycles >= begin) & (cycles < RETURN))


def filled(value: float) -> Callable[[Any, int], Any]:
    """Return a fault with one value in all cycles; -infinity = the last good one."""

    def fault(values: Any, begin: int) -> Any:
        found = values.copy()
        found[begin:RETURN] = values[begin - 1] if np.isneginf(value) else value
        return found

    return fault


LOST = {"late": dead, "NaN": filled(np.nan), "infinity": filled(np.inf), "frozen": filled(-np.inf)}


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    with Blocks(tmp_path_factory.mktemp("sensors"), TYPES) as blocks:
        yield blocks


def good(random: np.random.Generator) -> Any:
    """Return the measurements of a joint that moves."""
    time = DT * np.arange(LENGTH)
    return np.sin(random.uniform(1.0, 8.0) * time) + random.normal(scale=1e-4, size=LENGTH)


def run(blocks: Blocks, case: Case, columns: Values, **parameters: Any) -> Any:
    """Return the output, NaN before the first one."""
    inputs = {**case.inputs, **columns}
    found = blocks.run(case.component, inputs, LENGTH, **{**case.parameters, **parameters})
    return found[case.output]


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("kind", LOST)
def test_a_lost_sensor_leads_to_the_safe_output_in_time(
    blocks: Blocks, name: str, kind: str
) -> None:
    case = CASES[name]
    random = np.random.default_rng([len(name), len(kind)])
    for broken in case.measured:
        begin = int(random.integers(50, 150))
        columns = {each: good(random) for each in case.measured}
        columns[broken] = LOST[kind](columns[broken], begin)
        limit = {"frozen_timeout": TIMEOUT} if kind == "frozen" else {}
        out = run(blocks, case, columns, **limit)
        assert np.isfinite(out[1:]).all()
        assert np.abs(out).max() <= case.largest + 1e-12
        assert np.abs(np.diff(out)).max() <= case.changes
        safe = begin + round((TIMEOUT + case.slows_s) / DT)
        assert np.allclose(out[safe:RETURN], case.safe, rtol=0, atol=1e-12), broken
        # Before, it is not yet safe; afterwards, the component works again.
        assert out[begin + round(TIMEOUT / DT) - 2] != case.safe
        assert (out[RETURN + 100 :] != case.safe).any()
        if case.holds and kind in ("NaN", "infinity"):
            assert (out[begin : begin + 150] == out[begin - 1]).all()


@pytest.mark.parametrize("name", CASES)
def test_sensors_out_of_range_or_with_jumps_leave_the_output_in_its_limits(
    blocks: Blocks, name: str
) -> None:
    case = CASES[name]
    random = np.random.default_rng(len(name))
    columns = {}
    for each in case.measured:
        column = good(random)
        for _ in range(8):
            begin = int(random.integers(1, LENGTH - 60))
            column[begin : begin + int(random.integers(1, 50))] = random.choice(
                [1e300, -1e300, 1e9, -1e9, 50.0, -50.0, 0.0, np.nan, np.inf]
            )
        columns[each] = column
    out = run(blocks, case, columns)
    assert np.isfinite(out[1:]).all()
    assert np.abs(out).max() <= case.largest + 1e-12
    assert np.abs(np.diff(out)).max() <= case.changes


@pytest.mark.parametrize("role", ["observer", "KalmanFilter"])
def test_an_estimate_without_measurements_is_not_new_for_long(blocks: Blocks, role: str) -> None:
    measured = dead(np.sin(0.01 * np.arange(LENGTH)), 100)
    model: Values = {"A": "0 1; 0 0", "B": "", "C": "1 0"}
    if role == "observer":
        found = blocks.run("StateSpace", {"measured1": measured}, role=role, **model)
    else:
        found = blocks.run(role, {"measured1": measured}, measurement_timeout=TIMEOUT, **model)
    changed = np.flatnonzero(np.diff(found["out1"]) != 0.0) + 1
    assert not ((changed > 100 + TIMEOUT / DT + 1) & (changed < RETURN)).any()
    assert (changed >= RETURN).sum() > 200


def test_without_a_limit_the_last_value_counts(blocks: Blocks) -> None:
    measured = dead(good(np.random.default_rng(1)), 100)
    out = run(blocks, CASES["Pid"], {"measured": measured}, measurement_timeout=1e9)
    assert (out[400:RETURN] == 4.0).all()


def test_a_slow_sensor_makes_no_spikes_of_the_derivative(blocks: Blocks) -> None:
    # 100 Hz, now and then late by half a period, with a slope of 1.
    cycles = np.arange(2000)
    sent = (cycles % 10 == 0) ^ np.isin(cycles, [500, 505, 900, 905])
    measured = MASKED.array(DT * cycles, mask=~sent)
    for filter_time in (0.0, 0.02):
        out = blocks.run("Pid", {"setpoint": 0.0, "measured": measured}, kp=0.0, kd=1.0,
                         filter_time=filter_time)["effort"]  # fmt: skip
        assert np.allclose(out[600:], -1.0, rtol=0, atol=1e-9), filter_time


def test_a_sensor_that_stops_has_no_slope(blocks: Blocks) -> None:
    cycles = np.arange(200)
    measured = MASKED.array(DT * cycles, mask=cycles >= 100)
    out = blocks.run("Pid", {"setpoint": 0.0, "measured": measured}, kp=0.0, kd=1.0)["effort"]
    assert out[99] == pytest.approx(-1.0)
    assert (out[103:] == 0.0).all()


def test_the_lost_sensor_is_named_with_its_reason(stepped: Bench) -> None:
    block = Stepped(stepped, "Pid", kp=1.0)
    try:
        block.step(10, setpoint=1.0, measured=0.0)
        assert stepped.client.get_component("/stepped/block").fault == ""
        block.step(400)
        found = stepped.client.get_component("/stepped/block")
        assert "measured has no new value within measurement_timeout" in found.fault
        assert found.faults == 410 - 1 - round(TIMEOUT / DT)
        assert found.state == graph_pb2.COMPONENT_STATE_FAULTED
    finally:
        block.unload()


GRAVITY = "GravityCompensation"
PENDULUM = """<robot name="pendulum"><link name="base"/>
<link name="rod"><inertial><origin xyz="1 0 0"/><mass value="2"/>
<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
<joint name="pivot" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 -1 0"/>
</joint></robot>"""


def load_gravity(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_control", GRAVITY, name=GRAVITY, ns=f"/{GRAVITY}",
                               parameters=[f"urdf:={PENDULUM}"]))  # fmt: skip


@pytest.mark.parametrize("kind", ["late", "NaN", "frozen"])
def test_gravity_without_a_sensor_holds_the_last_positions(stepped: Bench, kind: str) -> None:
    client = stepped.client
    load_gravity(client)
    name = f"/{GRAVITY}/{GRAVITY}"
    try:
        if kind == "frozen":
            client.set_parameters(name, [rtcf.parse_parameter("frozen_timeout:=0.2")])
        sent = {"late": [], "NaN": [float("nan")], "frozen": [0.5]}[kind]
        for position in (0.4, 0.5):
            client.write(f"{name}.measured", {"position": [position]})
            client.step(1)
        for cycle in range(202):
            if sent:
                client.write(f"{name}.measured", {"position": sent})
            client.step(1)
            found = client.get_component(name)
            assert bool(found.fault) == (cycle >= 200)
            effort = next(parse(each.value) for each in found.states if each.name == "last")[0]
            assert effort == pytest.approx(2.0 * 9.80665 * np.cos(0.5))
        reason = "changed within frozen_timeout" if kind == "frozen" else "no new value within"
        assert reason in found.fault
        assert found.fault.endswith(": command holds the robot at its last positions")
    finally:
        client.unload([name])
        client.stop()


def test_the_table_in_the_docs_names_these_defaults(blocks: Blocks) -> None:
    text = (TREE / "docs" / "control" / "index.md").read_text()
    section = text.partition("## Lost sensors")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)`[^|]*\|[^|]*\| ([\d.]+|none) \|", section, re.MULTILINE)
    assert {name for name, _ in rows} == {*TYPES, GRAVITY}
    load_gravity(blocks.client)
    for name, limit in rows:
        component = blocks.client.get_component(f"/{name}/{name}")
        default = {each.name: each.default_value.double_value for each in component.parameters}
        expected = np.inf if limit == "none" else float(limit)
        assert default["measurement_timeout"] == expected, name
