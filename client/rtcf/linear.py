"""Linear systems for components in Python: compiled when a hook calls them, else plain NumPy."""

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]


def expm(a: Array) -> Array:
    """Return the exponential of a square matrix, by a Padé approximant of order 6 and squaring.

    Raises ValueError if the matrix is not square or not finite.
    """
    n = a.shape[0]
    if a.shape[1] != n:
        raise ValueError("the matrix of expm is not square")
    norm = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(a[i, j])
        if not np.isfinite(row):
            raise ValueError("the matrix of expm is not finite")
        norm = max(norm, row)
    factor = 1.0
    squarings = 0
    while norm * factor > 0.5:
        factor *= 0.5
        squarings += 1
    scaled = a * factor
    power = scaled * 1.0
    part = 0.5
    above = np.eye(n) + part * power
    below = np.eye(n) - part * power
    sign = 1.0
    for k in range(2, 7):
        part *= (7.0 - k) / (k * (13.0 - k))
        power = scaled @ power
        above += part * power
        below += sign * part * power
        sign = -sign
    result = np.linalg.solve(below, above)
    for _ in range(squarings):
        result = result @ result
    return result


def c2d(a: Array, b: Array, dt: float) -> tuple[Array, Array]:
    """Discretise x' = a x + b u with zero-order hold; dt in seconds.

    `a` is (n, n), `b` is (n, inputs); returns matrices of the same shapes. Raises ValueError as
    expm does.
    """
    n, inputs = b.shape
    both = np.zeros((n + inputs, n + inputs))
    both[:n, :n] = a * dt
    both[:n, n:] = b * dt
    stepped = expm(both)
    return stepped[:n, :n].copy(), stepped[:n, n:].copy()


def tustin(a: Array, b: Array, dt: float) -> tuple[Array, Array]:
    """Discretise x' = a x + b u by the trapezoidal rule; dt in seconds.

    `a` is (n, n), `b` is (n, inputs); returns matrices of the same shapes. Raises ValueError if
    2 / dt is an eigenvalue of `a`.
    """
    n = a.shape[0]
    left = np.eye(n) - (0.5 * dt) * a
    right = np.eye(n) + (0.5 * dt) * a
    return np.linalg.solve(left, right), np.linalg.solve(left, b * dt)
