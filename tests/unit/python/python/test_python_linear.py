"""rtcf.linear against closed-form solutions."""

import math

import numpy as np
import pytest
from rtcf.linear import c2d, expm, tustin


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 2.0, 50.0])
def test_the_exponential_of_a_rotation(angle: float) -> None:
    found = expm(np.array([[0.0, -angle], [angle, 0.0]]))
    cosine, sine = math.cos(angle), math.sin(angle)
    assert found == pytest.approx(np.array([[cosine, -sine], [sine, cosine]]), abs=1e-13)


def test_the_exponential_of_a_diagonal_or_nilpotent_matrix() -> None:
    assert expm(np.diag([1.0, -3.0, 20.0])) == pytest.approx(
        np.diag(np.exp([1.0, -3.0, 20.0])), rel=1e-12
    )
    shift = np.diag([2.0, 3.0], 1)
    assert expm(shift) == pytest.approx(np.eye(3) + shift + shift @ shift / 2.0, rel=1e-14)
    assert np.array_equal(expm(np.zeros((4, 4))), np.eye(4))


@pytest.mark.parametrize("seed", range(5))
def test_the_exponential_of_any_matrix(seed: int) -> None:
    matrix = np.random.default_rng(seed).normal(0.0, 2.0, (5, 5))
    values, vectors = np.linalg.eig(matrix)
    expected = (vectors * np.exp(values)) @ np.linalg.inv(vectors)
    assert expm(matrix) == pytest.approx(expected.real, rel=1e-9, abs=1e-9)


def test_a_held_input_on_two_integrators() -> None:
    a, b = c2d(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), 0.1)
    assert a == pytest.approx(np.array([[1.0, 0.1], [0.0, 1.0]]), abs=1e-15)
    assert b == pytest.approx(np.array([[0.005], [0.1]]), rel=1e-13)


def test_the_trapezoidal_rule_on_a_lag() -> None:
    a, b = tustin(np.array([[-2.0]]), np.array([[3.0]]), 0.1)
    assert (a[0, 0], b[0, 0]) == pytest.approx((0.9 / 1.1, 0.3 / 1.1))


def test_a_matrix_without_exponential_is_rejected() -> None:
    with pytest.raises(ValueError, match="not square"):
        expm(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="not finite"):
        expm(np.array([[np.inf, 0.0], [0.0, 1.0]]))
    with pytest.raises(ValueError, match="not finite"):
        expm(np.array([[0.0, np.nan], [0.0, 1.0]]))
