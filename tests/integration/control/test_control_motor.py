"""rtcf_control/Motor against exact solutions, and against scipy's integration with events.

Tolerances, as parts of the largest value: linear motion is a sum of steps of RK4 of at most 0.25 of
the fastest time constant, LINEAR. With dry friction each stop is found by one secant, FRICTION.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from block_bench import Blocks, Stepped, rejection
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from rtcf.testing import Bench
from scipy import integrate, signal

DT = 0.001
LINEAR, FRICTION = 1e-5, 1e-3
STEPS = 1000
SOFT: dict[str, Any] = {
    "inertia": 1e-4,
    "load_inertia": 4e-4,
    "stiffness": 5.0,
    "damping": 2e-3,
    "viscous": 1e-3,
}
DRY: dict[str, Any] = {"coulomb": 0.02, "static_friction": 0.03, "stribeck_velocity": 0.5}
WINDING: dict[str, Any] = {
    "drive": "voltage",
    "torque_constant": 0.05,
    "resistance": 0.8,
    "inductance": 2e-3,
}
WALK = np.repeat(np.random.default_rng(5).normal(0.0, 0.06, STEPS // 40), 40)
OUTPUTS = ("position", "velocity", "load_position", "load_velocity")


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    with Blocks(tmp_path_factory.mktemp("motor"), ["Motor"]) as blocks:
        yield blocks


def close(found: Any, expected: Any, tolerance: float) -> bool:
    """Return whether values are equal to a part of the largest one."""
    return bool(np.max(np.abs(found - expected)) <= tolerance * np.max(np.abs(expected)))


def exact(command: Any, load: Any, **p: Any) -> Any:
    """Return the outputs of a linear motor with an elastic shaft at the end of each cycle."""
    j, k, d = (p[name] for name in ("inertia", "stiffness", "damping"))
    jl, b = p["load_inertia"], p["viscous"]
    a = np.array(
        [
            [0, 1, 0, 0, 0],
            [-k / j, -(d + b) / j, k / j, d / j, 0],
            [0, 0, 0, 1, 0],
            [k / jl, d / jl, -k / jl, -d / jl, 0],
            [0, 0, 0, 0, 0],
        ]
    )
    inputs = np.zeros((5, 2))
    inputs[3, 1] = -1 / jl
    if "inductance" in p:
        kt, inductance = p["torque_constant"], p["inductance"]
        a[1, 4] = kt / j
        a[4] = [0, -kt / inductance, 0, 0, -p["resistance"] / inductance]
        inputs[4, 0] = 1 / inductance
    else:
        inputs[1, 0] = 1 / j
    system = signal.cont2discrete((a, inputs, np.eye(5), np.zeros((5, 2))), DT)
    state, found = np.zeros(5), []
    for u in np.stack([command, load], axis=1):
        state = system[0] @ state + system[1] @ u
        found.append(state)
    return np.array(found)


def test_linear_motion_is_the_exact_one(blocks: Blocks) -> None:
    load = np.where(np.arange(STEPS) > 600, 0.01, 0.0)
    found = blocks.run("Motor", {"command": WALK, "load_torque": load}, **SOFT)
    expected = exact(WALK, load, **SOFT)
    for column, name in enumerate(OUTPUTS):
        assert close(found[name], expected[:, column], LINEAR), name
    assert found["torque"].tolist() == WALK.tolist()


def test_a_winding_has_its_current_and_its_back_emf(blocks: Blocks) -> None:
    volts = 50.0 * WALK
    found = blocks.run("Motor", {"command": volts}, **SOFT, **WINDING)
    numbers = {name: value for name, value in WINDING.items() if isinstance(value, float)}
    expected = exact(volts, np.zeros(STEPS), **SOFT, **numbers)
    for column, name in enumerate(OUTPUTS):
        assert close(found[name], expected[:, column], LINEAR), name
    assert close(found["torque"], 0.05 * expected[:, 4], LINEAR)


def test_a_winding_without_inductance_is_a_first_order_lag(blocks: Blocks) -> None:
    found = blocks.out(
        "Motor", {"command": np.full(STEPS, 2.0)}, output="velocity",
        drive="voltage", torque_constant=0.05, resistance=0.5, inertia=1e-4, viscous=1e-3,
    )  # fmt: skip
    damping = 1e-3 + 0.05**2 / 0.5
    final = 0.05 * 2.0 / 0.5 / damping
    time = DT * np.arange(1, STEPS + 1)
    assert close(found, final * -np.expm1(-time * damping / 1e-4), LINEAR)


@pytest.mark.parametrize("load_inertia", [0.0, 3e-4])
def test_a_rigid_shaft_adds_the_inertias(blocks: Blocks, load_inertia: float) -> None:
    found = blocks.run("Motor", {"command": np.full(STEPS, 0.01), "load_torque": 0.004},
                       inertia=1e-4, load_inertia=load_inertia)  # fmt: skip
    time = DT * np.arange(1, STEPS + 1)
    slope = 0.006 / (1e-4 + load_inertia)
    assert close(found["velocity"], slope * time, LINEAR)
    assert close(found["position"], slope * time**2 / 2.0, LINEAR)
    assert found["load_position"].tolist() == found["position"].tolist()
    assert found["load_velocity"].tolist() == found["velocity"].tolist()


@seed(31)
@settings(max_examples=15, deadline=None)
@given(
    inertia=st.floats(1e-5, 1e-2),
    ratio=st.floats(0.1, 10.0),
    frequency=st.floats(5.0, 250.0),
    shaft=st.floats(0.0, 0.3),
    friction=st.floats(0.0, 20.0),
)
def test_random_linear_motors_are_the_exact_ones(
    blocks: Blocks, inertia: float, ratio: float, frequency: float, shaft: float, friction: float
) -> None:
    load = inertia * ratio
    reduced = inertia * load / (inertia + load)
    stiffness = reduced * (2.0 * np.pi * frequency) ** 2
    damping = 2.0 * shaft * np.sqrt(stiffness * reduced)
    motor: dict[str, Any] = {"inertia": inertia, "load_inertia": load, "stiffness": stiffness,
             "damping": damping, "viscous": friction * inertia}  # fmt: skip
    command = WALK[:400] * inertia * 1e4
    # Without damping, errors of the phase add up: (2 pi frequency step)^5 / 120 in each step.
    found = blocks.run("Motor", {"command": command}, step=2e-5, **motor)
    expected = exact(command, np.zeros(400), **motor)
    for column, name in enumerate(OUTPUTS):
        assert close(found[name], expected[:, column], LINEAR), name


# Friction.


def dry_friction(speed: float) -> Any:
    """Return the dry friction by the formula of the page."""
    drop = DRY["static_friction"] - DRY["coulomb"]
    return DRY["coulomb"] + drop * float(np.exp(-((speed / DRY["stribeck_velocity"]) ** 2)))


def with_events(command: Any) -> Any:
    """Return the motion of an elastic motor with dry friction, by Radau and its events."""
    j, k, d = (SOFT[name] for name in ("inertia", "stiffness", "damping"))
    jl, b = SOFT["load_inertia"], SOFT["viscous"]

    def shaft(x: Any) -> Any:
        return k * (x[0] - x[2]) + d * (x[1] - x[3])

    state, found = np.zeros(4), []
    for u in command:
        left = DT
        while left > 1e-12:
            torque = u - shaft(state)
            if state[1] != 0.0:
                direction = float(np.sign(state[1]))
            else:
                sticks = abs(torque) <= DRY["static_friction"]
                direction = 0.0 if sticks else float(np.sign(torque))

            def rates(_: float, x: Any, s: float = direction, u: float = u) -> list[float]:
                own = 0.0
                if s:
                    own = (u - shaft(x) - s * dry_friction(x[1]) - b * x[1]) / j
                return [x[1] if s else 0.0, own, x[3], shaft(x) / jl]

            def rests(_: float, x: Any, s: float = direction) -> float:
                return float(s * x[1] + (0.0 if s else 1.0))

            def starts(_: float, x: Any, s: float = direction, u: float = u) -> Any:
                return 1.0 if s else DRY["static_friction"] - abs(u - shaft(x))

            events: list[Any] = [rests, starts]
            for event in events:
                event.terminal, event.direction = True, -1.0
            done = integrate.solve_ivp(rates, (0.0, left), state, method="Radau",
                                       rtol=1e-8, atol=1e-11, events=events)  # fmt: skip
            state = done.y[:, -1]
            left -= done.t[-1]
            if done.t_events[0].size:
                state[1] = 0.0
            elif done.t_events[1].size:
                state[1] = 1e-12 * np.sign(u - shaft(state))
        found.append(state)
    return np.array(found)


def test_dry_friction_is_that_of_an_integration_with_events(blocks: Blocks) -> None:
    found = blocks.run("Motor", {"command": WALK}, **SOFT, **DRY)
    expected = with_events(WALK)
    assert (found["velocity"] == 0.0).sum() > 50  # it sticks, and moves
    for column, name in enumerate(OUTPUTS):
        assert close(found[name], expected[:, column], FRICTION), name


def test_the_rotor_starts_above_its_static_friction_only(blocks: Blocks) -> None:
    ramp = np.linspace(0.0, 0.05, STEPS)
    position = blocks.out("Motor", {"command": ramp}, output="position", **DRY)
    begun = np.flatnonzero(position)[0]
    assert ramp[begun] > DRY["static_friction"] >= ramp[begun - 1]
    backwards = blocks.out("Motor", {"command": -ramp}, output="position", **DRY)
    assert backwards.tolist() == (-position).tolist()


def test_coulomb_friction_stops_the_rotor_after_its_time(blocks: Blocks) -> None:
    push = np.where(np.arange(STEPS) < 100, 0.05, 0.0)
    found = blocks.run("Motor", {"command": push}, coulomb=0.02, inertia=1e-3)
    # 30 rad/s² for 0.1 s, then -20 rad/s² for 0.15 s.
    assert close(found["velocity"][:250], np.interp(DT * np.arange(1, 251), [0, 0.1, 0.25],
                 [0, 3.0, 0]), LINEAR)  # fmt: skip
    assert (found["velocity"][251:] == 0.0).all()
    assert (found["position"][251:] == found["position"][251]).all()
    assert found["position"][-1] == pytest.approx(0.15 + 0.225, rel=LINEAR)


@pytest.mark.parametrize("speed", [0.2, 1.0, 5.0])
def test_constant_velocity_needs_the_torque_of_the_stribeck_curve(
    blocks: Blocks, speed: float
) -> None:
    # Held by a winding without resistance to speak of: voltage is velocity.
    found = blocks.run("Motor", {"command": np.full(STEPS, 0.05 * speed)}, drive="voltage",
                       resistance=1e-3, inertia=0.01, viscous=1e-3, **DRY)  # fmt: skip
    last = float(found["velocity"][-1])
    assert last == pytest.approx(speed, rel=0.1)
    assert found["torque"][-1] == pytest.approx(dry_friction(last) + 1e-3 * last, rel=1e-6)


# Limits, encoder, step.


@pytest.mark.parametrize("more", [{}, WINDING, {**WINDING, "inductance": 0.0}])
def test_the_torque_stays_within_its_limit(blocks: Blocks, more: dict[str, Any]) -> None:
    command = np.where(np.arange(STEPS) % 400 < 200, 10.0, -10.0)
    torque = blocks.out("Motor", {"command": command}, output="torque", torque_limit=0.04, **more)
    assert np.abs(torque).max() <= 0.04 * (1 + 1e-15)
    assert np.abs(torque).max() == pytest.approx(0.04)


def test_the_encoder_counts(blocks: Blocks) -> None:
    sine = 0.02 * np.sin(np.arange(STEPS) * 0.02)
    plain = blocks.run("Motor", {"command": sine})
    found = blocks.run("Motor", {"command": sine}, encoder=500.0)
    count = 2.0 * np.pi / 500.0
    assert found["position"].tolist() == (count * np.floor(plain["position"] / count)).tolist()
    assert np.allclose(found["velocity"], np.diff(found["position"], prepend=0.0) / DT, rtol=1e-12)
    assert found["load_position"].tolist() == plain["load_position"].tolist()


def test_a_shorter_step_changes_little(blocks: Blocks) -> None:
    coarse = blocks.run("Motor", {"command": WALK}, **SOFT, **DRY)
    fine = blocks.run("Motor", {"command": WALK}, **SOFT, **DRY, step=1e-5)
    for name in OUTPUTS:
        assert close(coarse[name], fine[name], FRICTION), name


def test_it_stands_still_without_a_command(blocks: Blocks) -> None:
    found = blocks.run("Motor", steps=10, **SOFT)
    assert all((found[name] == 0.0).all() for name in (*OUTPUTS, "torque"))


def test_values_that_are_not_finite_leave_outputs_and_state(blocks: Blocks) -> None:
    command = np.array([0.01, 0.01, np.nan, np.inf, 0.01])
    found = blocks.run("Motor", {"command": command})
    whole = blocks.run("Motor", {"command": np.full(3, 0.01)})
    assert found["velocity"][[0, 1, 4]].tolist() == whole["velocity"].tolist()
    assert (found["velocity"][2:4] == found["velocity"][1]).all()
    load = blocks.run("Motor", {"command": 0.01, "load_torque": command})
    assert (load["velocity"][2:4] == load["velocity"][1]).all()


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"stiffness": 1.0}, "stiffness needs a load_inertia above 0"),
        ({"damping": 1.0}, "damping needs a stiffness above 0: without one the shaft is rigid"),
        ({**SOFT, "stiffness": 5e4}, "step = 0.0001 s is too long for the fastest motion, 2.5"),
        ({"step": 1e-7}, "step = 1e-07 s: a cycle of 0.001 s has at most 1000 steps"),
        ({"inertia": 0.0}, "parameter inertia = 0 is below its minimum 1e-12 kg m²"),
        ({"coulomb": -1.0}, "coulomb"),
        ({"torque_limit": -1.0}, "torque_limit"),
        ({"drive": "current"}, "drive"),
    ],
)
def test_parameters_that_do_not_fit_are_rejected_with_one_line(
    blocks: Blocks, parameters: dict[str, Any], said: str
) -> None:
    with rejection(said):
        blocks.set("Motor", **parameters)


def test_a_replacement_continues_the_motion(stepped: Bench) -> None:
    motor = Stepped(stepped, "Motor", **SOFT, **DRY)
    motor.step(50, command=0.05)
    before = motor.state
    stepped.client.replace("/stepped/block", motor.spec(**SOFT, **DRY))
    assert motor.state == before
    after = motor.step(1)
    assert after["angle"] > before["angle"] > 0.0
    motor.unload()
