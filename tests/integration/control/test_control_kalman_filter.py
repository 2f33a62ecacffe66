"""rtcf_control/KalmanFilter against a Kalman filter in plain NumPy and scipy.linalg.

Tolerances: estimates and deviations of up to 300 cycles differ from those of the textbook form by
less than ROUNDING, relative to the largest one: both lose digits by the condition of the innovation
covariance, up to 1e4 here. Gains of the Riccati equation differ from scipy's by less than GAINS.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from block_bench import Blocks, Stepped, columns, rejection, text
from rtcf.testing import Bench
from rtcf.v1 import runner_pb2
from scipy import integrate, linalg, signal

DT = 0.001
ROUNDING = 1e-9
GAINS = 1e-7
MASKED: Any = np.ma
CYCLES = 300


@dataclass
class Model:
    """A discrete system with its noises."""

    a: Any
    b: Any
    c: Any
    d: Any
    q: Any
    r: Any

    def parameters(self) -> dict[str, Any]:
        return {"A": text(self.a), "B": text(self.b), "C": text(self.c), "D": text(self.d),
                "process_noise": text(self.q), "measurement_noise": text(self.r),
                "form": "discrete"}  # fmt: skip


def random_model(states: int = 4, inputs: int = 2, measured: int = 3) -> Model:
    """Return a system with an unstable mode."""
    draw = np.random.default_rng(29)
    a = draw.normal(size=(states, states))
    root = draw.normal(size=(measured, measured))
    return Model(
        a / np.max(np.abs(linalg.eigvals(a))) * 1.01,
        draw.normal(size=(states, inputs)),
        draw.normal(size=(measured, states)),
        draw.normal(size=(measured, inputs)),
        np.diag(np.linspace(0.1, 1.0, states)),
        root @ root.T + 0.1 * np.eye(measured),
    )


MODEL = random_model()


def filtered(model: Model, u: Any, y: Any, *, late: bool = False) -> tuple[Any, Any]:
    """Return estimates and deviations of the textbook form; NaN in y is a missing measurement."""
    states = len(model.a)
    x, p, last = np.zeros(states), np.eye(states), None
    estimates, deviations = [], []
    for now, seen in zip(u, y, strict=True):
        if last is not None:
            x = model.a @ x + model.b @ (now if late else last)
            p = model.a @ p @ model.a.T + model.q
        here = np.flatnonzero(np.isfinite(seen))
        if len(here):
            h = model.c[here]
            gain = p @ h.T @ linalg.inv(h @ p @ h.T + model.r[np.ix_(here, here)])
            x = x + gain @ (seen[here] - h @ x - (0.0 if late else model.d[here] @ now))
            p = (np.eye(states) - gain @ h) @ p
        last = now
        estimates.append(x)
        deviations.append(np.sqrt(np.diag(p)))
    return np.array(estimates), np.array(deviations)


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    with Blocks(tmp_path_factory.mktemp("kalman_filter"), ["KalmanFilter"]) as blocks:
        yield blocks


def run(
    blocks: Blocks, u: Any, y: Any, states: int, **parameters: Any
) -> tuple[Any, Any, dict[str, Any]]:
    """Return estimates, deviations and all outputs of two equal runs."""
    inputs = columns("in", u) | columns("measured", y)
    names = [f"{kind}{i + 1}" for kind in ("out", "deviation") for i in range(states)]
    first = blocks.run_twice("KalmanFilter", names, inputs, **parameters)
    found = np.stack([first[name] for name in names], axis=1)
    return found[:, :states], found[:, states:], first


def signals(model: Model, cycles: int = CYCLES) -> tuple[Any, Any]:
    """Return inputs, and noisy measurements of the model."""
    draw = np.random.default_rng(7)
    u = draw.uniform(-1.0, 1.0, (cycles, model.b.shape[1]))
    x = np.zeros(len(model.a))
    y = []
    for now in u:
        y.append(
            model.c @ x + model.d @ now + draw.multivariate_normal(np.zeros(len(model.c)), model.r)
        )
        x = model.a @ x + model.b @ now + draw.multivariate_normal(np.zeros(len(x)), model.q)
    return u, np.array(y)


def assert_near(found: Any, expected: Any, tolerance: float = ROUNDING) -> None:
    assert np.max(np.abs(found - expected)) <= tolerance * np.max(np.abs(expected))


def gaps(y: Any) -> Any:
    """Return measurements of which a third is missing, each on its own, and all for a while."""
    missing = np.random.default_rng(3).random(y.shape) < 1.0 / 3.0
    missing[50:70] = True
    missing[0] = False
    return np.where(missing, np.nan, y)


@pytest.mark.parametrize("late", [False, True], ids=["present", "previous"])
def test_estimates_are_those_of_the_textbook(blocks: Blocks, late: bool) -> None:
    model = random_model()
    model.d = model.d * (0.0 if late else 1.0)
    u, y = signals(model)
    found = run(blocks, u, y, 4, **model.parameters(),
                input_time="previous" if late else "present")  # fmt: skip
    for each, expected in zip(found[:2], filtered(model, u, y, late=late), strict=True):
        assert_near(each, expected)
    assert set(found[2]["used"]) == {3}
    assert set(found[2]["age"]) == {0.0}


def test_measurements_that_are_not_finite_are_missing(blocks: Blocks) -> None:
    u, y = signals(MODEL)
    seen = gaps(y)
    given = np.where(np.isnan(seen) & (np.arange(len(y)) % 2 == 0)[:, None], np.inf, seen)
    found = run(blocks, u, given, 4, **MODEL.parameters())
    for each, expected in zip(found[:2], filtered(MODEL, u, seen), strict=True):
        assert_near(each, expected)
    assert found[2]["used"].tolist() == np.isfinite(seen).sum(axis=1).tolist()
    assert found[2]["age"][69] == pytest.approx(20 * DT)


def test_measurements_without_a_new_value_are_missing(blocks: Blocks) -> None:
    u, y = signals(MODEL)
    seen = gaps(y)
    inputs = columns("in", u) | {
        name: MASKED.array(np.nan_to_num(column), mask=np.isnan(column))
        for name, column in columns("measured", seen).items()
    }
    found = blocks.run("KalmanFilter", inputs, **MODEL.parameters())
    expected = run(blocks, u, seen, 4, **MODEL.parameters())[2]
    for name in ("out1", "out4", "deviation1", "deviation4", "used", "age", "squared_error"):
        assert found[name].tobytes() == expected[name].tobytes()


def test_one_state_and_twelve(blocks: Blocks) -> None:
    for size in (1, 12):
        model = random_model(size, size, size)
        u, y = signals(model)
        found = run(blocks, u, y, size, **model.parameters())
        for each, expected in zip(found[:2], filtered(model, u, y), strict=True):
            assert_near(each, expected, 1e-7 if size == 12 else ROUNDING)


def test_a_continuous_model_is_discretised_exactly(blocks: Blocks) -> None:
    a, b, c = np.array([[0.0, 1.0], [-100.0, -2.0]]), np.array([[0.0], [50.0]]), np.eye(1, 2)
    q, r = np.array([[0.1, 0.2], [0.2, 3.0]]), np.array([[0.01]])
    noise, _ = integrate.quad_vec(
        lambda s: linalg.expm(a * s) @ q @ linalg.expm(a.T * s), 0.0, DT, epsrel=1e-12, epsabs=0.0
    )
    moved, driven, _, d, _ = signal.cont2discrete((a, b, c, np.zeros((1, 1))), DT, "zoh")
    model = Model(moved, driven, c, d, noise, r)
    u, y = signals(model)
    found = run(blocks, u, y, 2, A=text(a), B=text(b), C=text(c), process_noise=text(q),
                measurement_noise='0.01')  # fmt: skip
    for each, expected in zip(found[:2], filtered(model, u, y), strict=True):
        assert_near(each, expected)


def test_the_steady_state_is_that_of_scipy(blocks: Blocks) -> None:
    u, y = signals(MODEL)
    p = linalg.solve_discrete_are(MODEL.a.T, MODEL.c.T, MODEL.q, MODEL.r)
    gain = p @ MODEL.c.T @ linalg.inv(MODEL.c @ p @ MODEL.c.T + MODEL.r)
    x, expected = np.zeros(4), []
    for k, seen in enumerate(y):
        if k > 0:
            x = MODEL.a @ x + MODEL.b @ u[k - 1]
        x = x + gain @ (seen - MODEL.c @ x - MODEL.d @ u[k])
        expected.append(x)
    found, deviations, _ = run(blocks, u, y, 4, **MODEL.parameters(), steady=True)
    assert_near(found, np.array(expected), GAINS)
    settled = np.sqrt(np.diag((np.eye(4) - gain @ MODEL.c) @ p))
    assert_near(deviations, np.tile(settled, (CYCLES, 1)), GAINS)
    # The full filter settles there.
    assert_near(run(blocks, u, y, 4, **MODEL.parameters())[1][-1], settled, GAINS)


def test_the_deviations_and_the_squared_error_are_right_on_average(blocks: Blocks) -> None:
    # Of 2000 cycles with 3 measurements: the mean of chi^2 / 3 is 1, its own deviation 0.02.
    model = random_model()
    model.a = model.a * 0.9
    u, y = signals(model, 2000)
    response = run(blocks, u, y, 4, **model.parameters())[2]
    assert np.mean(response["squared_error"][100:]) / 3.0 == pytest.approx(1.0, abs=0.1)


def test_measurements_that_are_almost_exact_keep_the_covariance_positive(blocks: Blocks) -> None:
    # The textbook form loses all digits here: 1e12 times more certain, and twice the same.
    y = np.ones((CYCLES, 2))
    _, deviations, response = run(
        blocks, np.zeros((CYCLES, 0)), y, 2, A="0 1; 0 0", B="", C="1 0; 1 0",
        process_noise="1e-8", measurement_noise="1e-8", initial_covariance="1e4",
    )  # fmt: skip
    assert (deviations > 0.0).all()
    assert_near(response["out1"][10:], 1.0, 1e-4)


def test_nothing_is_written_before_the_first_measurement(blocks: Blocks) -> None:
    y = MASKED.array(np.ones(6), mask=[True, True, False, True, True, False])
    response = blocks.run("KalmanFilter", {"measured1": y}, B="")
    assert np.isfinite(response["out1"]).tolist() == [False, False, True, True, True, True]
    assert response["used"][2:].tolist() == [1, 0, 0, 1]


def test_an_input_that_is_not_finite_is_a_fault(blocks: Blocks) -> None:
    u, y = np.ones((50, 1)), np.zeros((50, 1))
    found = run(blocks, u, y, 1)[0]
    u[20:25] = np.nan
    held = run(blocks, u, y, 1)[0]
    assert (held[20:25] == held[19]).all()
    assert_near(held[25:], found[25:])


def test_a_new_period_is_designed_for(stepped: Bench) -> None:
    # A ramp of 1/s: a model with its velocity follows without lag at each frequency.
    block = Stepped(stepped, "KalmanFilter", A="0 1; 0 0", B="", C="1 0", process_noise="0 1",
                    measurement_noise='"1e-4"', steady=True, initial="0 1")  # fmt: skip
    time = -0.001
    try:
        for frequency, period in ((1000, 0.001), (250, 0.004), (2000, 0.0005)):
            stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=frequency))
            for _ in range(30):
                time += period
                state = block.step(measured1=time)
                assert state["estimate"][:2] == pytest.approx([time, 1.0], abs=1e-9)
    finally:
        block.unload()
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000))


def test_a_change_of_the_noises_keeps_the_estimate(stepped: Bench) -> None:
    block = Stepped(stepped, "KalmanFilter", B="", measurement_noise='"0.01"')
    try:
        before = block.step(500, measured1=2.0)["estimate"][0]
        block.set(measurement_noise='"1"', process_noise='"0.001"')
        assert block.step()["estimate"][0] == pytest.approx(before, abs=1e-6)
        block.set(A="0 1; 0 0", C="1 0", B='""', initial='"7"')
        assert block.step()["estimate"][:2] == pytest.approx([before, 7.0], abs=1e-6)
    finally:
        block.unload()


def test_a_replacement_a_snapshot_and_a_reset(stepped: Bench) -> None:
    block = Stepped(stepped, "KalmanFilter", A="0 1; 0 0", B="0; 1", C="1 0")
    try:
        block.step(10, in1=1.0, measured1=1.0)
        taken = stepped.client.take_snapshot().snapshot
        # A replacement has not read its inputs, so that their values are new measurements.
        first = block.step(50, measured1=2.0)
        stepped.client.restore_snapshot(taken)
        assert block.step(50, measured1=2.0) == first
        stepped.client.restore_snapshot(taken)
        assert not stepped.client.replace("/stepped/block", block.spec()).notes
        assert block.step(50, measured1=2.0) == first
        stepped.client.reset_state("/stepped/block")
        assert not block.state["begun"]
        assert block.step(measured1=4.0)["states"] == 2
    finally:
        block.unload()


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"A": "1 2; 3"}, "A: row 2 has 1 numbers, and row 1 has 2"),
        ({"A": "1 0; 0 1"}, "B has 1 rows, and A has 2"),
        ({"C": "1 2"}, "C has 2 columns, and A has 1"),
        ({"A": "", "B": "", "D": "1"}, "A: a filter needs at least one state"),
        ({"A": "1e6"}, "A and B are too large for a period of 0.001 s"),
        ({"D": "1", "input_time": "previous"}, "D must be 0 if input_time = previous"),
        ({"process_noise": "-1"}, "process_noise: the eigenvalue -1 is below 0"),
        ({"process_noise": "1 2"}, "process_noise: 1 x 2 numbers; write 1, 1 or 1 x 1"),
        ({"measurement_noise": "0"}, "measurement_noise: the eigenvalue 0 is not above 0"),
        ({"initial": "1 2"}, "initial: 2 numbers; write 1, or one for all"),
        ({"initial_covariance": "-1"}, "initial_covariance: the eigenvalue -1 is below 0"),
        ({"steady": True, "C": "0"}, "A, C: the measurements do not show the mode at z = 1, so"),
        ({"steady": True, "process_noise": "0"},
         "A, process_noise: no noise moves the mode at z = 1, so there is no steady state"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_rejected_with_one_line(
    blocks: Blocks, parameters: dict[str, Any], said: str
) -> None:
    with rejection(said):
        blocks.set("KalmanFilter", **parameters)
