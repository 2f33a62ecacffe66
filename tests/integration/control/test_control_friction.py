"""rtcf_control/FrictionCompensation against its equations and a joint with friction.

Tolerances: efforts of size 1 to 20 differ from NumPy's by less than ROUNDING.
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
from values import port_value

DT = 0.001
ROUNDING = 1e-12
TYPE = "FrictionCompensation"
LAW: dict[str, Any] = {"coulomb": 2.0, "breakaway": 3.5, "viscous": 0.8, "stribeck_velocity": 0.05}
SWEEP = np.linspace(-1.5, 1.5, 2001)


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    with Blocks(tmp_path_factory.mktemp("friction"), [TYPE]) as blocks:
        yield blocks


def friction(
    v: Any, coulomb: float, breakaway: float, viscous: float, stribeck: float,
    exponent: float = 2.0, smoothing: float = 0.01,
) -> Any:  # fmt: skip
    """Return the friction of Armstrong-Hélouvry et al., with a smooth sign."""
    falling = (breakaway - coulomb) * np.exp(-((np.abs(v) / stribeck) ** exponent))
    return (coulomb + falling) * np.tanh(v / smoothing) + viscous * v


@seed(29)
@settings(max_examples=10, deadline=None)
@given(
    st.floats(0.0, 10.0), st.floats(0.01, 10.0), st.floats(0.0, 5.0), st.floats(0.01, 1.0),
    st.floats(0.5, 3.0), st.floats(1e-3, 0.1),
)  # fmt: skip
def test_the_effort_is_that_of_the_law(
    blocks: Blocks, coulomb: float, more: float, viscous: float, stribeck: float,
    exponent: float, smoothing: float,
) -> None:  # fmt: skip
    out = blocks.out(
        TYPE, {"velocity": SWEEP}, output="effort", coulomb=coulomb, breakaway=coulomb + more,
        viscous=viscous, stribeck_velocity=stribeck, stribeck_exponent=exponent,
        smoothing=smoothing,
    )  # fmt: skip
    law = friction(SWEEP, coulomb, coulomb + more, viscous, stribeck, exponent, smoothing)
    assert np.allclose(out, law, rtol=ROUNDING, atol=ROUNDING)


def test_the_effort_is_odd_and_smooth_at_velocity_0(blocks: Blocks) -> None:
    out = blocks.out(TYPE, {"velocity": SWEEP}, output="effort", **LAW)
    other = blocks.out(TYPE, {"velocity": -SWEEP}, output="effort", **LAW)
    assert np.array_equal(out, -other)
    assert blocks.out(TYPE, {"velocity": 0.0}, 2, output="effort", **LAW).tolist() == [0.0, 0.0]
    near = np.linspace(-1e-5, 1e-5, 101)
    out = blocks.out(TYPE, {"velocity": near}, output="effort", **LAW)
    # The slope at 0 is breakaway / smoothing + viscous.
    assert np.allclose(out, (3.5 / 0.01 + 0.8) * near, rtol=1e-5, atol=0.0)


def test_without_breakaway_static_friction_is_that_of_coulomb(blocks: Blocks) -> None:
    law: dict[str, Any] = {**LAW, "breakaway": 0.0}
    out = blocks.out(TYPE, {"velocity": SWEEP}, output="effort", **law)
    assert np.allclose(out, friction(SWEEP, 2.0, 2.0, 0.8, 0.05), rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_a_share_is_compensated_within_the_largest_effort(blocks: Blocks, share: float) -> None:
    out = blocks.out(TYPE, {"velocity": SWEEP}, output="effort", share=share, max_effort=2.2, **LAW)
    expected = np.clip(share * friction(SWEEP, 2.0, 3.5, 0.8, 0.05), -2.2, 2.2)
    assert np.allclose(out, expected, rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize(("share", "kept"), [(1.0, 1.0), (0.5, None), (0.0, 0.0)])
def test_a_joint_with_friction_coasts_as_if_it_had_none(
    stepped: Bench, share: float, kept: float | None
) -> None:
    inertia, speed = 0.25, 0.6
    block = Stepped(stepped, TYPE, share=share, max_effort=50.0, **LAW)
    try:
        block.step(velocity=speed)
        for _ in range(400):
            effort = port_value(stepped.client, "/stepped/block", "effort")
            resisted = friction(speed, 2.0, 3.5, 0.8, 0.05)
            speed += DT / inertia * (effort - resisted)
            block.step(velocity=speed)
    finally:
        block.unload()
    if kept is None:
        assert abs(speed) < 1e-3, "half of the friction still stops it"
    else:
        assert speed == pytest.approx(0.6 * kept, abs=1e-3)


def test_values_that_are_not_finite_leave_the_effort_as_it_is(blocks: Blocks) -> None:
    velocity = np.array([0.2, 0.2, np.nan, np.inf, -np.inf, 0.2])
    out = blocks.out(TYPE, {"velocity": velocity}, output="effort", **LAW)
    assert np.isfinite(out).all()
    assert (out == out[0]).all()


def test_nothing_is_written_before_the_first_velocity(blocks: Blocks) -> None:
    masked: Any = np.ma
    velocity = masked.array([9.0, 9.0, 0.5], mask=[True, True, False])
    out = blocks.out(TYPE, {"velocity": velocity}, output="effort", **LAW)
    assert np.isnan(out[:2]).all() and out[2] > 2.0


def test_large_velocities_have_finite_efforts(blocks: Blocks) -> None:
    velocity = np.array([1e6, -1e6, 1e150, -1e150, 1e-300, -1e-300, 0.0])
    out = blocks.out(TYPE, {"velocity": velocity}, output="effort", **LAW)
    assert np.allclose(out, friction(velocity, 2.0, 3.5, 0.8, 0.05), rtol=1e-12, atol=0.0)


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"coulomb": 2.0, "breakaway": 1.0},
         "breakaway = 1 is below coulomb = 2; 0 stands for coulomb"),
        ({"coulomb": -1.0}, "coulomb"),
        ({"viscous": -1.0}, "viscous"),
        ({"smoothing": 0.0}, "smoothing"),
        ({"stribeck_velocity": 0.0}, "stribeck_velocity"),
        ({"share": 1.1}, "share"),
        ({"fade": -1.0}, "fade"),
    ],
)  # fmt: skip
def test_parameters_that_do_not_fit_are_rejected_with_one_line(
    blocks: Blocks, parameters: dict[str, Any], said: str
) -> None:
    with rejection(said):
        blocks.set(TYPE, **parameters)


def test_changes_of_parameters_do_not_make_the_effort_jump(stepped: Bench) -> None:
    block = Stepped(stepped, TYPE, fade=0.1, **LAW)

    def next_effort(velocity: float = 0.3) -> float:
        block.step(velocity=velocity)
        return port_value(stepped.client, "/stepped/block", "effort")

    try:
        before = next_effort()
        assert before == pytest.approx(friction(0.3, 2.0, 3.5, 0.8, 0.05), abs=ROUNDING)
        block.set(coulomb=3.0)
        efforts = [next_effort() for _ in range(51)]
        after = friction(0.3, 3.0, 3.5, 0.8, 0.05)
        share = np.arange(51) / 100.0
        assert np.allclose(efforts, before + (after - before) * share, rtol=0, atol=1e-9)
        # A change during the transition, which follows the velocity meanwhile.
        block.set(viscous=2.0)
        moved = next_effort(0.4)
        rest = 1.0 - 0.51
        last = friction(0.4, 3.0, 3.5, 0.8, 0.05) + rest * (before - after)
        assert moved == pytest.approx(last, abs=1e-9)
        for _ in range(101):
            moved = next_effort(0.4)
        assert moved == pytest.approx(friction(0.4, 3.0, 3.5, 2.0, 0.05), abs=1e-9)
        block.set(fade=0.0)
        block.set(share=0.5)
        assert next_effort(0.4) == pytest.approx(moved / 2.0, abs=1e-9)
    finally:
        block.unload()


def test_a_transition_survives_replacement_and_snapshot(stepped: Bench) -> None:
    block = Stepped(stepped, TYPE, fade=0.1, **LAW)
    try:
        block.step(velocity=0.3)
        block.set(coulomb=3.0)
        block.step(30, velocity=0.3)
        taken = stepped.client.take_snapshot().snapshot
        expected = [block.step()["rest"] for _ in range(20)]
        stepped.client.restore_snapshot(taken)
        changed: dict[str, Any] = {**LAW, "coulomb": 3.0, "fade": 0.1}
        same = block.spec(**changed)
        assert not stepped.client.replace("/stepped/block", same).notes
        assert [block.step()["rest"] for _ in range(20)] == expected
    finally:
        block.unload()
