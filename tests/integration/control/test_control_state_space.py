"""rtcf_control/StateSpace against scipy.signal, scipy.linalg and plain NumPy.

Tolerances: outputs of up to 300 cycles differ from their references by less than ROUNDING times the
largest output, as each cycle rounds by 1e-16 times at most 24 terms. Gains of Riccati equations
differ from scipy's by less than GAINS, relative to the largest one: both methods lose digits by the
condition of the problem, up to 1e6 here. Poles that are placed differ from the wanted ones by less
than POLES times their distance to 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rtcf
from block_bench import PATH, Blocks, Stepped, columns, rejection, text
from rtcf.testing import Bench
from rtcf.v1 import runner_pb2
from scipy import integrate, linalg, signal

DT = 0.001
ROUNDING = 1e-9
GAINS = 1e-7
POLES = 1e-6
MASKED: Any = np.ma
# A cart with a pendulum upright, measured at its position and angle.
CART_A = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, -0.1, 2.0, 0.0], [0.0, 0.0, 0.0, 1.0],
                   [0.0, -0.3, 30.0, 0.0]])  # fmt: skip
CART_B = np.array([[0.0], [1.0], [0.0], [3.0]])
CART_C = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


CART = {"A": text(CART_A), "B": text(CART_B), "C": text(CART_C)}
# Texts of one number, for the command line.
QUOTED = {name: f'"{value}"' for name, value in CART.items()}


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    with Blocks(tmp_path_factory.mktemp("state_space"), ["StateSpace"]) as blocks:
        yield blocks


def run(blocks: Blocks, inputs: dict[str, Any], outputs: int, **parameters: Any) -> Any:
    """Return the outputs of two equal runs, a row for each cycle."""
    names = [f"out{i + 1}" for i in range(outputs)]
    first = blocks.run_twice("StateSpace", names, inputs, **parameters)
    return np.stack([first[name] for name in names], axis=1)


def system(states: int, inputs: int, outputs: int, seed: int) -> tuple[Any, Any, Any, Any]:
    """Return a random continuous system with time constants from 2 ms to 1 s."""
    draw = np.random.default_rng(seed)
    turn = linalg.qr(draw.normal(size=(states, states)))[0]
    a = turn @ np.diag(-np.geomspace(1.0, 500.0, states)) @ turn.T
    a += draw.normal(size=(states, states))
    return (a, draw.normal(size=(states, inputs)), draw.normal(size=(outputs, states)),
            draw.normal(size=(outputs, inputs)))  # fmt: skip


def assert_near(found: Any, expected: Any, tolerance: float = ROUNDING) -> None:
    assert np.max(np.abs(found - expected)) <= tolerance * np.max(np.abs(expected))


# The system.


@pytest.mark.parametrize(("form", "scipys"), [("zoh", "zoh"), ("tustin", "bilinear")])
@pytest.mark.parametrize(("states", "inputs", "outputs"), [(1, 1, 1), (2, 1, 3), (5, 3, 2),
                                                           (12, 12, 12)])  # fmt: skip
def test_a_system_answers_as_that_of_scipy(
    blocks: Blocks, form: str, scipys: str, states: int, inputs: int, outputs: int
) -> None:
    a, b, c, d = system(states, inputs, outputs, 29)
    u = np.random.default_rng(7).uniform(-1.0, 1.0, (300, inputs))
    found = run(blocks, columns("in", u), outputs, A=text(a), B=text(b), C=text(c), D=text(d),
                form=form)  # fmt: skip
    discrete = signal.cont2discrete((a, b, c, d), DT, scipys)
    assert_near(found, signal.dlsim(discrete, u)[1])


def test_a_discrete_system_answers_as_that_of_scipy(blocks: Blocks) -> None:
    a, b, c, d = system(4, 2, 3, 5)
    a /= 1.1 * np.max(np.abs(linalg.eigvals(a)))
    u = np.random.default_rng(7).uniform(-1.0, 1.0, (300, 2))
    found = run(blocks, columns("in", u), 3, A=text(a), B=text(b), C=text(c), D=text(d),
                form="discrete", initial="1 -2 3 -4")  # fmt: skip
    expected = signal.dlsim((a, b, c, d, 1.0), u, x0=[1.0, -2.0, 3.0, -4.0])[1]
    assert_near(found, expected)


def test_a_stiff_system_is_exact(blocks: Blocks) -> None:
    # Time constants of 1 µs and 1 s: the answer to a step is analytic.
    found = run(blocks, {"in1": np.ones(300)}, 2, A="-1e6 0; 0 -1", B="1e6; 1")
    time = DT * np.arange(300)
    expected = np.stack([-np.expm1(-1e6 * time), -np.expm1(-time)], axis=1)
    assert_near(found, expected)


def test_an_integrator_that_others_lack_is_exact(blocks: Blocks) -> None:
    # A is singular and defective: a chain of three integrators.
    found = run(blocks, {"in1": np.ones(300)}, 3, A="0 1 0; 0 0 1; 0 0 0", B="0; 0; 1")
    time = DT * np.arange(300)
    assert_near(found, np.stack([time**3 / 6.0, time**2 / 2.0, time], axis=1))


def test_a_system_without_states_is_a_matrix(blocks: Blocks) -> None:
    u = np.random.default_rng(7).uniform(-1.0, 1.0, (20, 2))
    found = run(blocks, columns("in", u), 3, A="", B="", C="", D="1 2; 3 4; 5 6")
    assert_near(found, u @ np.array([[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]]))


def test_a_system_without_inputs_moves_by_itself(blocks: Blocks) -> None:
    response = blocks.run("StateSpace", {}, 300, A="0 1; -100 0", B="", initial="1 0")
    assert_near(response["out1"], np.cos(10.0 * DT * np.arange(300)))


def test_a_loop_over_a_system_can_be_closed() -> None:
    # An input without a value counts as 0, so that the system writes in its first cycle.
    with Bench("rtcf_control/StateSpace", path=PATH, initial="2") as bench:
        assert bench.run({}, 3)["out1"].tolist() == [2.0, 2.0, 2.0]


def test_values_that_are_not_finite_leave_outputs_and_state_as_they_are(blocks: Blocks) -> None:
    u = np.random.default_rng(7).uniform(-1.0, 1.0, 100)
    bad = np.isin(np.arange(100), [5, 6, 50])
    given = np.where(bad, [np.nan, np.inf] * 50, u)
    model = {"A": "-3 1; 0 -20", "B": "0; 5"}
    found = run(blocks, {"in1": given}, 2, **model)
    assert (found[5:7] == found[4]).all()
    expected = run(blocks, {"in1": u[~bad]}, 2, **model)
    assert found[~bad].tobytes() == expected.tobytes()


def test_a_system_that_overflows_keeps_its_last_output(blocks: Blocks) -> None:
    found = run(blocks, {"in1": np.ones(200)}, 1, A="1e3", B="1", form="discrete")
    assert np.isfinite(found).all()


# Observers and controllers.


@pytest.mark.parametrize("form", ["zoh", "discrete"])
def test_the_gain_of_a_regulator_is_that_of_scipy(blocks: Blocks, form: str) -> None:
    a, b, c, _ = system(5, 2, 3, 11)
    q, r = c.T @ c + 0.1 * np.eye(5), np.array([[2.0, 0.5], [0.5, 1.0]])
    if form == "zoh":
        both = np.zeros((7, 7))
        both[:5, :5], both[:5, 5:] = a, b
        weight = linalg.block_diag(q, r)
        cost, _ = integrate.quad_vec(
            lambda s: linalg.expm(both.T * s) @ weight @ linalg.expm(both * s), 0.0, DT,
            epsrel=1e-12, epsabs=0.0,
        )  # fmt: skip
        moved, driven = linalg.expm(both * DT)[:5, :5], linalg.expm(both * DT)[:5, 5:]
    else:
        a /= 0.9 * np.max(np.abs(linalg.eigvals(a)))  # unstable
        moved, driven, cost = a, b, linalg.block_diag(q, r)
    x = linalg.solve_discrete_are(moved, driven, cost[:5, :5], cost[5:, 5:], s=cost[:5, 5:])
    expected = linalg.solve(
        cost[5:, 5:] + driven.T @ x @ driven, driven.T @ x @ moved + cost[5:, :5]
    )
    found = run(blocks, columns("measured", np.eye(5)), 2, A=text(a), B=text(b), form=form,
                role="regulator", state_cost=text(q), input_cost=text(r))  # fmt: skip
    assert_near(-found.T, expected, GAINS)


def estimates(model: tuple[Any, ...], gain: Any, u: Any, y: Any, *, late: bool = False) -> Any:
    """Return the estimates of an observer in plain NumPy."""
    a, b, c, d = model
    x, last = np.zeros(len(a)), None
    rows = []
    for now, seen in zip(u, y, strict=True):
        if last is not None:
            x = a @ x + b @ (now if late else last)
        x = x + gain @ (seen - c @ x - (0.0 if late else d @ now))
        last = now
        rows.append(x)
    return np.array(rows)


@pytest.mark.parametrize("form", ["zoh", "discrete"])
@pytest.mark.parametrize("late", [False, True], ids=["present", "previous"])
def test_a_kalman_observer_is_that_of_scipy(blocks: Blocks, form: str, late: bool) -> None:
    a, b, c, d = system(5, 2, 3, 17)
    d *= 0.0 if late else 1.0
    draw = np.random.default_rng(7)
    u, y = draw.uniform(-1.0, 1.0, (100, 2)), draw.uniform(-1.0, 1.0, (100, 3))
    q, r = b @ b.T + 0.1 * np.eye(5), np.diag([0.1, 0.2, 0.3])
    if form == "zoh":
        noise, _ = integrate.quad_vec(
            lambda s: linalg.expm(a * s) @ q @ linalg.expm(a.T * s), 0.0, DT, epsrel=1e-12,
            epsabs=0.0,
        )  # fmt: skip
        model = signal.cont2discrete((a, b, c, d), DT, "zoh")[:4]
    else:
        a /= 0.9 * np.max(np.abs(linalg.eigvals(a)))  # unstable
        noise, model = q, (a, b, c, d)
    p = linalg.solve_discrete_are(model[0].T, c.T, noise, r)
    gain = p @ c.T @ linalg.inv(c @ p @ c.T + r)
    found = run(
        blocks, columns("in", u) | columns("measured", y), 5, A=text(a), B=text(b), C=text(c),
        D=text(d), form=form, role="observer", process_noise=text(q),
        measurement_noise="0.1 0.2 0.3", input_time="previous" if late else "present",
    )  # fmt: skip
    assert_near(found, estimates(model, gain, u, y, late=late), GAINS)


@pytest.mark.parametrize(
    ("a", "c", "poles"),
    [
        (CART_A, CART_C[:1], [-20.0, -30.0, -25.0 + 10.0j, -25.0 - 10.0j]),
        (CART_A, CART_C, [-20.0, -20.0, -20.0, -20.0]),
        (np.array([[-3.0]]), np.array([[2.0]]), [-50.0]),
        (np.diag(np.ones(5), 1), np.eye(1, 6), [-40.0, -41.0, -42.0, -43.0, -44.0, -45.0]),
    ],
    ids=["pendulum", "repeated", "one state", "six integrators"],
)
def test_an_observer_has_the_wanted_poles(blocks: Blocks, a: Any, c: Any, poles: Any) -> None:
    states, outputs = len(a), len(c)
    found = []
    for state in np.eye(states):
        # The error of the estimate after its first correction, and after the next one.
        parameters = {"A": text(a), "B": "", "C": text(c), "role": "observer", "observer": "poles",
                      "observer_poles": " ".join(f"{p.real}{p.imag:+}j" for p in poles),
                      "initial": " ".join(map(repr, state.tolist()))}  # fmt: skip
        zeros = {f"measured{i + 1}": np.zeros(2) for i in range(outputs)}
        found.append(run(blocks, zeros, states, **parameters))
    first, second = np.array(found).transpose(1, 2, 0)
    moved = linalg.expm(a * DT)
    # first = 1 - M C and second = (1 - M C) A first; the error moves by (1 - M C) A.
    assert_near(second, first @ moved @ first)
    wanted = np.exp(DT * np.array(poles))
    # Coefficients, as repeated poles are sensitive, of (z - 1) / DT.
    delta = (first @ moved - np.eye(states)) / DT
    assert np.allclose(np.poly(delta), np.poly((wanted - 1.0) / DT).real, rtol=POLES, atol=0.0)


def test_an_lqg_controller_is_observer_and_regulator(blocks: Blocks) -> None:
    u, y = np.zeros((100, 0)), np.random.default_rng(7).uniform(-0.01, 0.01, (100, 2))
    costs = {"state_cost": "10 1 10 1", "input_cost": "0.1"}
    noises = {"process_noise": "0.1 1 0.1 1", "measurement_noise": "1e-4"}
    found = run(blocks, columns("measured", y), 1, **CART, **costs, **noises, role="lqg",
                lower="-0.5", upper="0.4")[:, 0]  # fmt: skip
    gain = -run(blocks, columns("measured", np.eye(4)), 1, **CART, **costs, role="regulator")[:, 0]
    # The observer gets the limited input, which acts from the next cycle on.
    seen = columns("measured", y) | {"in1": np.concatenate([[0.0], found[:-1]])}
    states = run(blocks, seen, 4, **CART, **noises, role="observer", input_time="previous")
    assert_near(found, np.clip(-states @ gain, -0.5, 0.4), ROUNDING)
    assert (found == 0.4).any() and (found == -0.5).any() and u.size == 0


def test_an_lqg_controller_holds_a_pendulum_at_a_setpoint(tmp_path: Any) -> None:
    file = tmp_path / "loop.yaml"
    file.write_text(f"""\
components:
  - {{name: plant, package: rtcf_control, type: StateSpace, breaks: [in1],
     remaps: {{in1: /force, out1: /position, out2: /angle}},
     parameters: {{A: "{CART["A"]}", B: "{CART["B"]}", C: "{CART["C"]}", initial: "0 0 0.05 0"}}}}
  - {{name: controller, package: rtcf_control, type: StateSpace,
     remaps: {{measured1: /position, measured2: /angle, out1: /force}},
     parameters: {{A: "{CART["A"]}", B: "{CART["B"]}", C: "{CART["C"]}", role: lqg, tracked: "1",
                  process_noise: "0.01 1 0.01 1", measurement_noise: "1e-4",
                  state_cost: "10 1 10 1", input_cost: "0.1"}}}}
""")
    with Bench(str(file), path=PATH) as bench:
        setpoint = np.where(np.arange(20000) < 8000, 0.0, 0.3)
        found = bench.run({"/controller.in1": setpoint})
    assert abs(found["/plant.out2"]).max() < 0.5
    for cycle, wanted in ((7999, 0.0), (19999, 0.3)):
        assert found["/plant.out1"][cycle] == pytest.approx(wanted, abs=1e-3)
        assert found["/plant.out2"][cycle] == pytest.approx(0.0, abs=1e-3)


def test_a_controller_writes_nothing_before_all_measurements(blocks: Blocks) -> None:
    second = MASKED.array(np.zeros(5), mask=[True, True, False, False, False])
    found = run(blocks, {"measured1": np.ones(5), "measured2": second}, 1, **CART, role="lqg")
    assert np.isfinite(found[:, 0]).tolist() == [False, False, True, True, True]


def test_an_observer_goes_on_without_a_finite_measurement(blocks: Blocks) -> None:
    # An exact model from the exact state: the estimate is right after the gap, too.
    model = {"A": "0 1; -100 0", "B": "", "C": "1 0", "initial": "1 0"}
    exact = np.cos(10.0 * DT * np.arange(100))
    gap = (np.arange(100) >= 20) & (np.arange(100) < 60)
    found = run(blocks, {"measured1": np.where(gap, np.nan, exact)}, 2, role="observer", **model)
    assert (found[gap] == found[19]).all()
    assert_near(found[~gap, 0], exact[~gap])


# Changes while the loop runs.


@pytest.mark.parametrize("form", ["zoh", "tustin"])
def test_a_new_period_continues_the_system_exactly(stepped: Bench, form: str) -> None:
    # A free oscillation of 10 rad/s, for a constant input: zoh is exact, Tustin's method changes
    # its frequency by (10 h)^2 / 12 = 1.3e-4 at most, here 2e-3 rad.
    block = Stepped(stepped, "StateSpace", A="0 1; -100 0", B="0; 100", form=form,
                    initial="1 0")  # fmt: skip
    tolerance = 1e-9 if form == "zoh" else 5e-3
    time = -0.001
    try:
        block.write(in1=0.5)
        for frequency, period in ((1000, 0.001), (250, 0.004), (2000, 0.0005)):
            stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=frequency))
            for _ in range(50):
                time += period
                output = block.step()["last_output"][0]
                assert output == pytest.approx(0.5 + 0.5 * np.cos(10.0 * time), abs=tolerance)
    finally:
        block.unload()
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000))


def test_a_period_for_which_there_is_no_design_is_rejected(stepped: Bench) -> None:
    block = Stepped(stepped, "StateSpace", A='"500"', B='"1"', form="tustin")
    try:
        with pytest.raises(rtcf.RefusedError, match="A has an eigenvalue of 500 1/s, which tustin"):
            stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=250))
        block.step()
    finally:
        block.unload()


def test_other_matrices_change_the_output_without_a_jump(stepped: Bench) -> None:
    block = Stepped(stepped, "StateSpace", A='"-20"', B='"20"', fade=0.1)
    try:
        assert block.step(1000, in1=1.0)["last_output"][0] == pytest.approx(1.0, abs=1e-6)
        block.set(C='"3"')
        outputs = [block.step()["last_output"][0] for _ in range(120)]
        assert outputs[0] == pytest.approx(1.0, abs=1e-6)
        assert np.abs(np.diff(outputs)).max() < 0.021
        assert outputs[-1] == pytest.approx(3.0, abs=1e-6)
    finally:
        block.unload()


def test_another_size_keeps_the_states_that_remain(stepped: Bench) -> None:
    block = Stepped(stepped, "StateSpace", A="0 1; 0 0", B="0; 1", initial="3 0", fade=0.0)
    try:
        block.step()
        block.set(A='"0"', B='"1"', initial='"3"')
        assert block.step()["last_output"][0] == 3.0
    finally:
        block.unload()


def test_a_replacement_a_snapshot_and_a_reset(stepped: Bench) -> None:
    block = Stepped(stepped, "StateSpace", **CART, initial="0 0 0.1 0")
    try:
        block.step(10, in1=1.0)
        taken = stepped.client.take_snapshot().snapshot
        first = block.step(50)
        stepped.client.restore_snapshot(taken)
        assert block.step(50) == first
        stepped.client.restore_snapshot(taken)
        assert not stepped.client.replace("/stepped/block", block.spec()).notes
        assert block.step(50) == first
        stepped.client.reset_state("/stepped/block")
        assert block.step()["last_output"][:2] == [0.0, 0.1]
    finally:
        block.unload()


# Rejections.


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"A": "1 2; 3 x"}, 'A: x is not a number; write rows as in "0 1; -4 -0.5"'),
        ({"A": "1 nan; 0 1"}, "A: nan is not a number"),
        ({"A": "1 2; 3"}, "A: row 2 has 1 numbers, and row 1 has 2"),
        ({"A": "1 2"}, "A is 1 x 2, and not square"),
        ({"A": text(np.eye(13))}, "A: 13 x 13 is larger than 12 x 12"),
        ({"A": "1 0; 0 1"}, "B has 1 rows, and A has 2"),
        ({"C": "1 2"}, "C has 2 columns, and A has 1"),
        ({"D": "1 2"}, "D is 1 x 2; C and B need 1 x 1"),
        ({"A": "", "B": ""}, "A and D are empty: there is nothing to compute"),
        ({"A": "", "D": "1"}, "A is empty, so B and C must be empty, too"),
        ({"A": "1e6", "form": "zoh"}, "A and B are too large for a period of 0.001 s"),
        ({"A": "2000", "form": "tustin"}, "A has an eigenvalue of 2000 1/s, which tustin cannot"),
        ({"initial": "1 2"}, "initial: 2 numbers; write 1, or one for all"),
        ({"initial": "a"}, "initial: a is not a number"),
        ({"role": "observer", "form": "tustin"}, "form: tustin is for role = system; use zoh"),
        ({"role": "lqg", "A": "", "B": "", "D": "1"}, "A: this role needs at least one state"),
        ({"role": "lqg", "D": "1"}, "D must be 0 for role = lqg"),
        ({"role": "observer", "D": "1", "input_time": "previous"}, "D must be 0 if input_time ="),
        ({"role": "observer", "process_noise": "-1"}, "process_noise: the eigenvalue -1 is below"),
        ({"role": "observer", "measurement_noise": "0"}, "measurement_noise: the eigenvalue 0 is"),
        ({"role": "observer", "measurement_noise": "1 2"}, "1 x 2 numbers; write 1, 1 or 1 x 1"),
        ({"role": "observer", "C": "0"},
         "A, C: the measurements do not show the mode at z = 1"),
        ({"role": "observer", "process_noise": "0"},
         "A, process_noise: no noise moves the mode at z = 1"),
        ({"role": "observer", "observer": "poles"}, "observer_poles has 0 numbers, and A has 1"),
        ({"role": "observer", "observer": "poles", "observer_poles": "1"}, "1 is not stable"),
        ({"role": "observer", "observer": "poles", "observer_poles": "-1+1"}, "-1+1 is not a"),
        ({"role": "observer", "observer": "poles", "observer_poles": "-1+1j"},
         "-1+1j has no conjugate -1-1j"),
        ({"role": "observer", "observer": "poles", "observer_poles": "-1", "C": "0"},
         "do not show all modes, as observer_poles needs; use observer = kalman"),
        ({"role": "regulator", "B": ""}, "B is empty: LQR needs an input"),
        ({"role": "regulator", "B": "0"}, "A, B: the inputs do not move the mode at z = 1"),
        ({"role": "regulator", "A": "1 0; 0 -1", "B": "0; 1"},
         "A, B: the inputs do not move the mode at z = 1.001"),
        ({"role": "regulator", "state_cost": "0"},
         "A, state_cost: no cost weighs the mode at z = 1"),
        ({"role": "regulator", "A": "0 1; 0 0", "B": "0; 1", "state_cost": "1 2; 3 4"},
         "state_cost: the matrix is not symmetric"),
        ({"role": "regulator", "input_cost": "0"}, "input_cost: the eigenvalue 0 is not above 0"),
        ({"role": "regulator", "tracked": "2"}, "tracked: 2 is not a row of C, 1 to 1"),
        ({"role": "regulator", "A": "0 1; 0 0", "B": "0; 1", "tracked": "1 1"},
         "tracked: 1 is there twice"),
        ({"role": "regulator", "A": "0 1; 0 0", "B": "0; 1", "tracked": "1 2"},
         "tracked: 2 outputs cannot follow with 1 inputs"),
        ({"role": "regulator", "A": "0 1; 0 0", "B": "0; 1", "tracked": "2"},
         "tracked: these outputs cannot hold any setpoint"),
        ({"role": "regulator", "lower": "1", "upper": "0"}, "out1: lower = 1 is above upper = 0"),
        ({"role": "regulator", "safe_value": "1 2"}, "safe_value: 2 numbers; write 1, or one"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_rejected_with_one_line(
    blocks: Blocks, parameters: dict[str, str], said: str
) -> None:
    with rejection(said):
        blocks.set("StateSpace", **parameters)
